"""A fitted body in another recording of the same object, in which the same points were tracked."""

import warnings
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from model.errors import InputError
from model.gap.bodies.body import Body, grip_of
from model.gap.bodies.rest import rest_places
from model.gap.forecast import Forecast, forecast
from model.gap.hypothesis import Hypothesis
from model.gap.observer import Observer
from model.gap.plain import PlainTwin
from model.gap.prestress import Rest
from model.gap.study import PATIENCE, Study
from model.simulator.system import State
from model.types import Array, Observation

SETTLING = 2.0
"""Patiences of the observer, in which a body comes to terms with the pose in which it is found."""
ROUNDS = 8
"""Of moving the mass points until the observed points are where they are seen."""
SAME_HAND = 0.5
"""Spacings: controllers this near to where the body takes those of the first recording hold the same."""


@dataclass(frozen=True)
class Transferred:
    """The other recording, and how to make worlds for it: nothing of the object is fitted to it."""

    twin: PlainTwin
    """The same body, held as it is held there."""
    state: State
    """Where the mass points are in its first frame, at rest."""
    observer: Observer
    first: int
    """The first frame that is foretold."""

    def forecast(self, hypothesis: Hypothesis, values: dict[str, float]) -> Forecast:
        """What a twin foretells there that was fitted to the first recording.

        Args:
            hypothesis: Of the first recording.
            values: Its fitted values; what only this recording has, as a ground, is as usual.
        """
        plain = replace(hypothesis, twin=self.twin, effects=(), where=None)
        usual = plain.at({name: quantity.start for name, quantity in plain.quantities.items()})
        # what acts at a ground or a grip has nothing to act on where there is none
        able = tuple(effect for effect in hypothesis.effects if effect.unable(usual) is None)
        here = replace(hypothesis, twin=self.twin, effects=able)
        known = {name: values.get(name, quantity.start) for name, quantity in here.quantities.items()}
        return forecast(self.observer, here.at(known), self.first, self.state)


def transferred(study: Study, observation: Observation) -> Transferred:
    """The body of a study in another recording of its object.

    Rest shape, masses and rest lengths are those of the first recording. The first frame may show another
    pose: the body is turned and shifted onto it as a whole, then each mass point moves as the observed points
    near it do, and it starts at rest. What the hand holds is found anew.

    Raises:
        InputError: other points were tracked, or too few of them are seen in both.
    """
    twin = study.plain.twin
    points = _posed(twin.body, rest_places(study.observation), rest_places(observation))
    turned = _held_alike(twin, study.observation, observation, points)
    twin = turned or _held_anew(twin, observation, points)
    world = replace(study.plain, twin=twin)
    made = world.at({name: study.base.values.get(name, q.start) for name, q in world.quantities.items()})
    places = torch.from_numpy(points).to(made.system.points)
    times = observation.times - observation.times[0]
    first = int(np.searchsorted(times, SETTLING * PATIENCE))
    return Transferred(
        twin,
        State(places, torch.zeros_like(places)),
        Observer(observation, made, PATIENCE),
        max(1, min(first, len(times) // 2)),
    )


def _posed(body: Body, before: Float64[Array, "N 3"], after: Float64[Array, "M 3"]) -> Float64[Array, "P 3"]:
    """The mass points where the observed points say that they are [m]."""
    if before.shape != after.shape:
        raise InputError(
            f"points: the other recording has {len(after)}, the first {len(before)}: "
            "give one in which the same points were tracked, in the same order"
        )
    both = np.isfinite(before[:, 0]) & np.isfinite(after[:, 0])
    if both.sum() < 3:
        raise InputError(
            "points: fewer than three are seen in both recordings: "
            "give one in which the same points were tracked, in the same order"
        )
    here, there = before[both], after[both]
    with warnings.catch_warnings():
        # a straight rope may be rolled about itself by any angle, its points stay where they are
        warnings.filterwarnings("ignore", "Optimal rotation", UserWarning)
        turn = Rotation.align_vectors(there - there.mean(0), here - here.mean(0))[0]
    points: Float64[Array, "P 3"] = turn.apply(body.points - here.mean(0)) + there.mean(0)
    index, weight = body.index[both], body.weight[both]
    apart = np.linalg.norm(body.points[:, None] - here[None], axis=-1)
    near = np.exp(-0.5 * (apart / np.maximum(apart.min(1, keepdims=True), 0.7 * body.spacing)) ** 2)
    near /= near.sum(1, keepdims=True)
    for _ in range(ROUNDS):
        points = points + near @ (there - (weight[..., None] * points[index]).sum(1))
    return points


def _held_alike(
    twin: PlainTwin, before: Observation, after: Observation, points: Float64[Array, "P 3"]
) -> PlainTwin | None:
    """Held by the springs of a given twin's own hand, where the hand is where it was; else None."""
    hand, own = after.controllers[0].astype(np.float64), before.controllers[0].astype(np.float64)
    if twin.matter.grip_distance is not None or hand.shape != own.shape or not len(twin.body.grip):
        return None
    apart = np.linalg.norm(hand[twin.body.grip[:, 0]] - points[twin.body.grip[:, 1]], axis=1)
    first = np.linalg.norm(own[twin.body.grip[:, 0]] - twin.body.points[twin.body.grip[:, 1]], axis=1)
    if np.abs(apart - first).max() > SAME_HAND * twin.body.spacing:
        return None
    return replace(twin, observation=after, controls=after.controllers.astype(np.float64))


def _held_anew(twin: PlainTwin, observation: Observation, points: Float64[Array, "P 3"]) -> PlainTwin:
    """Held where the hand is now, with the material that it has."""
    grip = grip_of(points, observation.controllers[0].astype(np.float64), twin.body.spacing)
    found = PlainTwin.of(replace(twin.body, points=points, grip=grip), observation)
    own = twin.matter
    matter = replace(
        found.matter,
        mass=own.mass,
        pattern=own.pattern,
        length=own.length,
        start={**found.matter.start, **own.start},
        restitution=own.restitution,
        collision_distance=own.collision_distance,
    )
    heavier = float(own.mass.sum() / found.matter.mass.sum())
    return replace(
        twin,
        body=replace(found.body, points=twin.body.points),
        observation=observation,
        matter=matter,
        rest=Rest(twin.rest.tensions, heavier * found.rest.supports),
        controls=found.controls,
    )
