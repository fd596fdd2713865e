"""The plain twin: springs, dashpots, drag, ground and grip, and the parameters that are its own."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64
from scipy.spatial import cKDTree
from torch import Tensor

from model.gap.balanced import LONGEST, SHORTEST, Eased, balanced, displaced, weighing_more
from model.gap.bodies.aside import Skin
from model.gap.bodies.body import Body
from model.gap.bodies.falling import falls
from model.gap.bodies.grip import held_places, idle_hands
from model.gap.bodies.hand import steadied
from model.gap.carried import carrying_able
from model.gap.effects.base import Quantity
from model.gap.erring_hand import ErringHands
from model.gap.matter import ONE_HAND, Matter
from model.gap.prestress import Rest, resting
from model.gap.sight import Sight
from model.gap.slight_bending import slight_bending, stiffest_share
from model.gap.world import World
from model.gap.wrinkling import wrinkling
from model.schema import EffectRecord
from model.simulator.build import build_simulator
from model.types import Array, Observation

Values: TypeAlias = Mapping[str, Tensor]

FARTHEST = 0.5
"""Grasps: no spring of a hand is stretched by more than this in the first frame."""
DAMPED, DAMPED_ROPE = 0.4, 1.0
"""Share of the critical damping of a spring between two points that its dashpot has at most: an observer
shakes a lattice with the noise that it follows, and what is little damped goes on shaking. More needs finer
time steps, which ropes can afford."""
FIRM = 0.5
"""Springs of a hand are at least this stiff against those of the object: it holds, it does not dangle."""
UPRIGHT = {"rope": 4, "sheet": 3, "solid": 5}
"""Points near each controller that a hand holds at least a little: they carry its turns over."""
TAUT = 10.0
"""Cloth that is so many times stiffer than usual stretches by 0.3 % under its own weight, less than is seen:
what is stiffer still would only need finer time steps."""
BENDING = (0.003, 3.0)
"""Times what is usual that a plain sheet may resist bending, from silk on; what is beyond is an effect."""
MODES = {"rope": 1, "sheet": 2, "solid": 2}
"""Along so many of the longest axes of the body stiffness may grow from one end to the other."""
LEAST_AWAY = 1e-9
"""Length [m] below which a body has no extent along an axis: of a row of points two have none."""
EVEN = 0.225
"""Powers of e by which the ends of a body are usually stiffer or softer than its middle."""


@dataclass(frozen=True)
class PlainTwin:
    """What makes a world of its own parameters."""

    body: Body
    observation: Observation
    matter: Matter
    rest: Rest
    """With which the first frame is at rest."""
    controls: Float64[Array, "T H 3"]
    """Where the other ends of the springs of the grip are [m]: controllers without the noise of their
    measurement, or places of what they hold."""
    carried: tuple[EffectRecord, ...] = ()
    """Effects that a given twin has already; those that cannot act in the recording do not."""
    along: Body | None = None
    """Along whose axes stiffness varies, as of a coarser twin that was fitted; None: the body's own."""

    @classmethod
    def of(
        cls,
        body: Body,
        observation: Observation,
        matter: Matter | None = None,
        controls: Float64[Array, "T H 3"] | None = None,
    ) -> "PlainTwin":
        """For a body as it lies, hangs or is held in the first frame; without `matter` it is guessed.

        `controls` are the observation's controllers without their noise, unless they are given.

        A guessed body has no springs to the controllers: each point within reach of one is held where the
        hand carries it, so that the grip does not depend on where a lattice happens to have points.
        """
        if controls is None:
            controls = steadied(observation.controllers, observation.times)
        if matter is None:
            held = _reachable(body, observation)
            if len(held):
                controls = held_places(controls, body.points[held], ONE_HAND * body.grasp)
            body = replace(body, grip=np.stack([np.arange(len(held)), held], axis=1))
            matter = Matter.guessed(body, observation)
        bearing = np.zeros(len(body.points))
        reach = torch.tensor(matter.start.get("reach", 1.0) * body.grasp, dtype=torch.float64)
        np.maximum.at(bearing, body.grip[:, 1], matter.fading(reach).numpy())
        if observation.ground_height is not None:
            lying = observation.ground_height + body.above + 0.5 * body.spacing
            bearing[body.points[:, 2] < lying] = 1.0
        weights = matter.mass[:, None] * np.asarray(observation.gravity)
        if matter.slackness and falls(observation):
            # a cloth that nothing holds up hangs from nothing; a solid still gives way as it did when it lay
            weights = np.zeros_like(weights)
        rest = resting(body.points, body.springs, weights, bearing, pressing=1.0 - matter.slackness)
        return cls(body, observation, matter, rest, controls)

    @property
    def given(self) -> bool:
        """It came with parameters; else they are guessed."""
        return self.matter.given

    @property
    def ground_height(self) -> float | None:
        """Of the ground as its points meet it [m]: those in the middle of a thick rope never come down."""
        ground = self.observation.ground_height
        return None if ground is None else ground + self.body.above

    @property
    def hand_known(self) -> bool:
        """The hand is the one that it came with; else how it is held is a guess."""
        return self.matter.hold is None

    @property
    def idle(self) -> list[float]:
        """How far hands are in the first frame from a guessed body of which they hold nothing [m]."""
        if self.given:
            return []
        away = cKDTree(self.body.points).query(self.observation.controllers[0].astype(np.float64))[0]
        return [float(away[own].min()) for own in self._idle]

    @property
    def holders(self) -> Int64[Array, " c"]:
        """The controllers of hands that hold some of the body."""
        every = np.arange(self.observation.controllers.shape[1], dtype=np.int64)
        return np.setdiff1d(every, np.concatenate([every[:0], *self._idle]))

    @property
    def _idle(self) -> list[Int64[Array, " c"]]:
        """The controllers of each hand that holds nothing."""
        hands, body = self.observation.controllers[0].astype(np.float64), self.body
        if not len(hands):
            return []
        return idle_hands(hands, body.points[body.grip[:, 1]], ONE_HAND * body.grasp)

    @property
    def quantities(self) -> dict[str, Quantity]:
        """Its own parameters, with where they may be and where a fit starts."""
        start = self.matter.start
        usual = start["stiffness"]
        damped = DAMPED_ROPE if self.body.shape == "rope" else DAMPED
        own = {
            "stiffness": Quantity("N/m", (1e-3 * usual, self._stiffest * usual), usual, log=True),
            "damping": _reaching("1", (1e-4, damped), start["damping"], 2.0),
            "drag_rate": _reaching("1/s", (0.01, 20.0), start["drag_rate"], 1.5),
            "prestress": Quantity("1", (0.0, 1.2), start["prestress"], spread=0.6),
        }
        if len(self.body.grip):
            own["grip"] = _reaching("1", (FIRM, 50.0), start["grip"], 1.5)
            if not self.hand_known:
                own["reach"] = Quantity("1", (0.03, 1.5), start["reach"], log=True, spread=1.5)
            own |= self._hands.quantities(self.body.grasp)
        if self.observation.ground_height is not None:
            own["friction"] = _reaching("1", (0.02, 2.0), start["friction"], 1.0)
        if self.matter.bending_decay and self.matter.slackness:
            own["bending"] = Quantity("1", BENDING, start["bending"], log=True, spread=1.5)
            own["bending_decay"] = Quantity("1/s", (20.0, 1000.0), self.matter.bending_decay, log=True)
        elif self.matter.bending_decay and self.body.aside is not None and not self.given:
            most = stiffest_share(self.body, float(np.linalg.norm(self.observation.gravity)))
            own["bending"] = Quantity("1", (0.03, most), start["bending"], log=True, spread=1.5)
            own["memory_of_shape"] = Quantity("1", (0.0, 1.0), start["memory_of_shape"], spread=0.5)
        for mode in range(MODES[self.body.shape]):
            own[f"gradient_{mode + 1}"] = Quantity("1", (-1.5, 1.5), 0.0, spread=EVEN)
        return own

    @property
    def _hands(self) -> ErringHands:
        return ErringHands(self.matter.hold)

    @property
    def _stiffest(self) -> float:
        return TAUT if self.matter.slackness else 300.0

    def world(self, values: Values, dtype: torch.dtype = torch.float32) -> World:
        """The world of these parameters, each a scalar or of shape [*b, 1]."""
        body, seen, matter = self.body, self.observation, self.matter
        length = torch.from_numpy(matter.length)
        stiffness = values["stiffness"] * torch.from_numpy(matter.pattern) * self._gradient(values)
        tensions = torch.from_numpy(self.rest.tensions)
        bears = stiffness * torch.where(tensions < 0.0, 1.0 - matter.slackness, torch.ones_like(tensions))
        rest = torch.maximum(length - values["prestress"] * tensions / bears, SHORTEST * length)
        if matter.slackness:
            rest = torch.minimum(rest, LONGEST * length)
        typical = 2.0 * torch.sqrt(values["stiffness"] * float(np.median(matter.mass)))
        held = len(body.grip) > 0
        simulator = build_simulator(
            points=body.points,
            mass=matter.mass,
            springs=body.springs,
            rest_length=rest,
            stiffness=stiffness,
            controller_springs=body.grip if held else None,
            controller_rest_length=matter.grip_length if held else None,
            controller_stiffness=self._grip(values) if held else None,
            controller_points=self.controls[0] if held else None,
            dashpot_damping=values["damping"] * typical,
            drag_rate=values["drag_rate"],
            friction=values.get("friction", 0.0),
            restitution=matter.restitution,
            collision_distance=matter.collision_distance,
            bending_decay=values.get("bending_decay", matter.bending_decay),
            gravity=seen.gravity,
            ground_height=self.ground_height,
            dtype=dtype,
        )
        skin = None if body.aside is None else Skin.of(body.aside, dtype)
        sight = Sight(torch.from_numpy(body.index), torch.from_numpy(body.weight).to(dtype), skin)
        controls = self._controls(values, dtype) if held else None
        world = World(simulator, sight, seen.times, controls, self.ground_height)
        if not self.given:
            weight = float(matter.mass.sum() * np.linalg.norm(seen.gravity))
            share, memory = (values.get(name, 1.0) for name in ("bending", "memory_of_shape"))
            bending = slight_bending(body, weight, share, memory)
            world = world if bending is None else world.with_force(bending)
        if matter.slackness:
            world = world.with_force(wrinkling(world, matter.slackness))
        # another recording may have no ground, or nothing that holds the object
        return carrying_able(world, self.carried)

    def eased(self, plain: World, world: World, values: Values) -> Eased:
        """What puts a world with effects as much at rest in the first frame as the plain one of these values.

        Its springs pull there as they do in that one, and bear what weighs on it more; so does the hand.
        """
        weights, length = weighing_more(plain, world), self._first_length
        if weights is None:
            return Eased(balanced(plain, world, length))
        worlds = weights.reshape(-1, *weights.shape[-2:])
        tensions, supports = (torch.from_numpy(each) for each in self.rest.more(worlds.numpy()))
        if weights.ndim == worlds.ndim - 1:
            tensions, supports = tensions[0], supports[0]
        rest = balanced(plain, world, length, values["prestress"] * tensions)
        if world.controls is None or self.hand_known:
            return Eased(rest)
        known = torch.from_numpy(self.rest.supports)
        return Eased(rest, self._beyond(values, known + supports) - self._beyond(values, known))

    @property
    def _first_length(self) -> Float[Tensor, " E"]:
        """Of the springs where the body is at rest [m]: of a guessed one their own, but for prestress."""
        if not self.given:
            return torch.from_numpy(self.matter.length)
        ends = self.body.points[self.body.springs]
        return torch.from_numpy(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))

    def _grip(self, values: Values) -> Float[Tensor, "*b S"]:
        """Stiffness of the springs of the hand [N/m]: full where it is, fading with distance."""
        matter = self.matter
        stiffness: Tensor = values["grip"] * values["stiffness"] * torch.from_numpy(matter.grip_pattern)
        if self.hand_known:
            return stiffness
        aside = self._hands.aside(values)
        faded: Tensor = stiffness * matter.fading(values["reach"] * self.body.grasp, aside)
        return faded

    def _controls(self, values: Values, dtype: torch.dtype) -> Float[Tensor, "T *b H 3"]:
        """Where the springs of the hand end: beyond what they hold, so that they bear it at first."""
        controls = torch.from_numpy(self.controls).to(dtype)
        if self.hand_known:
            return controls
        controls = self._hands.displaced(controls, values, self.observation.times)
        return displaced(controls, self._beyond(values, torch.from_numpy(self.rest.supports)))

    def _beyond(self, values: Values, supports: Float[Tensor, "*s P 3"]) -> Float[Tensor, "*b H 3"]:
        """How far the ends of the springs of the hand are from what they hold [m], to bear this [N]."""
        load = supports[..., self.body.grip[:, 1], :]
        beyond = (values["prestress"] / self._grip(values)).unsqueeze(-1) * load
        far = FARTHEST * self.body.grasp
        return far * torch.tanh(beyond / far)

    def _gradient(self, values: Values) -> Float[Tensor, "*b E"]:
        """How stiffness varies over the body, 1 on average."""
        like = self.along or self.body
        centre = like.points.mean(0)
        # signs of these axes are arbitrary, and those of a square are: they go by the very points
        axes = np.linalg.svd(like.points - centre, full_matrices=False)[2]
        middle = self.body.points[self.body.springs].mean(1) - centre
        ends = like.points[like.springs].mean(1) - centre
        exponent = torch.zeros(len(middle), dtype=torch.float64)
        for mode in range(MODES[self.body.shape]):
            if f"gradient_{mode + 1}" in values:
                along = middle @ axes[mode] / max(float(np.abs(ends @ axes[mode]).max()), LEAST_AWAY)
                exponent = exponent + values[f"gradient_{mode + 1}"] * torch.from_numpy(along)
        return torch.exp(exponent)


def _reachable(body: Body, observation: Observation) -> Int64[Array, " H"]:
    """Points that a hand may hold: those near its controllers, and a few more to hold them upright."""
    if not len(body.grip):
        return np.zeros(0, np.int64)
    places = observation.controllers[0].astype(np.float64)
    near = cKDTree(body.points[np.unique(body.grip[:, 1])]).query(places)[0] <= 1.5 * body.grasp
    near[body.grip[:, 0]] = True
    places, tree = places[near], cKDTree(body.points)
    few = min(UPRIGHT[body.shape], len(body.points))
    held = {int(i) for near in tree.query_ball_point(places, 1.5 * body.grasp) for i in near}
    held |= {int(i) for i in tree.query(places, k=few)[1].ravel()}
    return np.array(sorted(held), np.int64)


def _reaching(unit: str, bounds: tuple[float, float], start: float, spread: float) -> Quantity:
    """One that spans decades, its bounds reaching to where a given twin is; it starts above zero in any case.

    Its logarithm is believed to be there, give or take `spread`.
    """
    low, high = bounds
    start = max(start, 0.1 * low)
    return Quantity(unit, (min(low, start), max(high, start)), start, log=True, spread=spread)
