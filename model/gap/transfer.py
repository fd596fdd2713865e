"""A fitted body in another recording of the same object."""

import warnings
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from model.gap.bodies.body import Body, between, grip_of, with_skin
from model.gap.bodies.hand import steadied
from model.gap.bodies.hidden import hiding
from model.gap.bodies.rest import rest_places
from model.gap.carried import idle
from model.gap.confirm import Fitted
from model.gap.erring_hand import HAND, HOLD
from model.gap.estimate import Estimate, estimate
from model.gap.forecast import Forecast, forecast
from model.gap.hypothesis import Hypothesis
from model.gap.misfit import Misfit, Span
from model.gap.noise import noise_of
from model.gap.observer import Observer
from model.gap.plain import PlainTwin
from model.gap.posed import posed
from model.gap.posed_by_shape import posed_by_shape
from model.gap.same_points import same_points
from model.gap.study import LEAST_NOISE, PATIENCE, STEPS, Study
from model.gap.world import World
from model.simulator.system import State
from model.types import Array, Observation

SETTLING = 2.0
"""Patiences of the observer, in which a body comes to terms with the pose in which it is found."""
LOOKED_AT = 0.2
"""Share of the frames, the first, that the recording's own is fitted to; those after it are foretold."""
RECORDINGS_OWN = ("grip", "reach", "prestress", HAND, HOLD)
"""How quantities begin that are of a recording, not of the object."""
LEAST_FRAMES = 6
"""Fewer tell nothing."""
SAME_HAND = 0.5
"""Grasps: controllers this near to where the body takes those of the first recording hold the same."""
SEEN = 0.25
"""Share of the points known in both recordings: where so many are seen in both first frames a body is laid on
these alone. From fewer, all on one side maybe, it lies worse than from all that are told by other frames."""
FEWEST = 3
"""Points that say how a body is turned."""


class Followed(NamedTuple):
    """A twin fitted to all frames of a recording."""

    misfit: Misfit
    estimate: Estimate


@dataclass(frozen=True)
class Transferred:
    """The other recording, and how to make worlds for it: what it is foretold by was not fitted to it.

    How a hand holds it there, and how much it is at rest at first, is the recording's own: each twin finds it
    for itself in the frames before the first that is foretold. What a twin without an effect takes it for
    makes up for that effect, and misleads a twin that has it.
    """

    twin: PlainTwin
    """The same body, held as it is held there."""
    state: State
    """Where the mass points are in its first frame, at rest."""
    observer: Observer
    first: int
    """The first frame that is foretold."""
    own: Mapping[str, float]
    """What the plain twin finds of what is the recording's own; with others it begins there."""
    noise: float
    """Standard deviation of the measured places there [m]."""

    @property
    def told_noise(self) -> float:
        """By which what is left is weighed [m]."""
        return max(self.noise, LEAST_NOISE)

    def forecast(self, hypothesis: Hypothesis, values: dict[str, float]) -> Forecast:
        """What a twin foretells there that was fitted to the first recording.

        Args:
            hypothesis: Of the first recording.
            values: Its fitted values; what only this recording has, as a ground, is as usual.
        """
        here = self.hypothesis(hypothesis)
        known = {name: values.get(name, quantity.start) for name, quantity in here.quantities.items()}
        known |= self.own
        known |= self.held(here, known, self.own)
        return forecast(self.observer, here.at(known), self.first, self.state)

    def held(
        self, hypothesis: Hypothesis, known: Mapping[str, float], own: Collection[str]
    ) -> dict[str, float]:
        """What is the recording's own, by the frames before the first that is foretold.

        Args:
            hypothesis: Of this recording.
            known: Values of all quantities; those of its own are where to begin.
            own: Names of these.
        """
        if not own:
            return {}
        free = hypothesis.holding({name: value for name, value in known.items() if name not in own})
        before = self.misfit(free).until(self.first - 1)
        return _fitted(before, known, slopes=False).values

    def followed(self, one: Fitted) -> Followed:
        """A twin in all frames of this recording, its effects as strong as in the first.

        Its own parameters follow: a twin without an effect makes up for it by wrong ones, which would be held
        against it here, and one with it has others.
        """
        here = self.hypothesis(one.hypothesis)
        values = one.estimate.values
        fixed = {name: values[name] for name in here.of_effects}
        return self._followed(here.holding(fixed), values, slopes=False)[0]

    def further(self, found: Followed) -> Followed:
        """The same after as many more steps; as it was where these lead to nothing better."""
        whole = len(self.twin.observation.times)
        more = estimate(found.misfit, found.estimate.vector[None], STEPS, whole, slopes=False)
        return Followed(found.misfit, more) if more.cost < found.estimate.cost else found

    def misfit(self, hypothesis: Hypothesis) -> Misfit:
        """Of a hypothesis over all frames.

        Args:
            hypothesis: Of this recording.
        """
        span = Span(0, len(self.twin.observation.times) - 1, self.state)
        return Misfit(hypothesis, self.observer, span, self.told_noise)

    def hypothesis(self, hypothesis: Hypothesis) -> Hypothesis:
        """One of the first recording for this one, in which what acts at a ground or a grip may have none."""
        plain = replace(hypothesis, twin=self.twin, effects=(), where=None)
        usual = plain.at({name: quantity.start for name, quantity in plain.quantities.items()})
        able = tuple(effect for effect in hypothesis.effects if effect.unable(usual) is None)
        return replace(hypothesis, twin=self.twin, effects=able)

    def _followed(
        self, hypothesis: Hypothesis, values: Mapping[str, float], *, slopes: bool = True
    ) -> tuple[Followed, dict[str, float]]:
        """What is free of a hypothesis, fitted from these values and the recording's own; and its start."""
        misfit = self.misfit(hypothesis)
        known = {**values, **self.own}
        start = {name: known.get(name, q.start) for name, q in hypothesis.quantities.items()}
        return Followed(misfit, _fitted(misfit, start, slopes=slopes)), start

    def study(self, first: Study) -> Study:
        """The plain twin fitted to this recording, for what it shows of effects: all frames are seen by it.

        Args:
            first: Of the first recording, whose parameters are the start.
        """
        seen = self.twin.observation
        plain = replace(first.plain, twin=self.twin)
        (misfit, base), start = self._followed(plain, first.base.values)
        return Study(seen, plain, self.observer, misfit, start, base, self.noise, len(seen.times))


def _fitted(misfit: Misfit, start: Mapping[str, float], *, slopes: bool) -> Estimate:
    """What is free, to all frames of a misfit at once."""
    vector = misfit.coordinates.vector(start)
    if misfit.hypothesis.effects:
        misfit.divide(vector)
    return estimate(misfit, vector[None], STEPS, misfit.span.last + 1, slopes=slopes)


def transferred(study: Study, observation: Observation) -> Transferred:
    """The body of a study in another recording of its object.

    Rest shape, masses and the tensions that bear it at rest are those of the first recording. Rest lengths
    are not: they follow from its stiffness and from how much of these tensions there is (`prestress`), which
    is found anew in each recording. Of a guessed solid or sheet lengths and tensions are those of its pose
    here: soft ones give way to their weight otherwise in each, and cloths hang in other folds, which a net
    that is stretched onto what is seen of it can hardly tell. The first frame may show another pose: the
    body is turned and shifted onto it as a whole, then the mass points move to where the observed points are
    seen, each much like those it is joined to, and it starts at rest. Where other points were tracked the
    shape of the object says where that is. What the hand holds is found anew.

    Raises:
        InputError: too few points are seen in both, or what is seen there is another object.
    """
    other = laid_there(study, observation)
    _say_idle(other.twin, _world_there(study, other.twin))
    return replace(other, own=_own(study, replace(study.plain, twin=other.twin), other))


def laid_there(study: Study, observation: Observation) -> Transferred:
    """The same before anything of it is fitted there: `own` is empty.

    Raises:
        InputError: as `transferred`.
    """
    twin = study.plain.twin
    here, there = rest_places(study.observation), rest_places(observation)
    if same_points(study.observation, observation):
        points = posed(twin.body, *_sure(here, there, study.observation, observation))
        body = _told_there(twin.body, here, there, points)
    else:
        points = posed_by_shape(twin.body, study.observation, observation)
        index, weight = between(there, points)
        body = replace(twin.body, index=index, weight=weight)
    if body.aside is not None:
        # how a rope is rolled about itself is another thing in each recording
        body = with_skin(body, there, points, observation.ground_height)
    twin = replace(twin, body=body)
    turned = _held_alike(twin, study.observation, observation, points)
    twin = turned or _held_anew(twin, observation, there, points)
    made = _world_there(study, twin)
    places = torch.from_numpy(points).to(made.system.points)
    times = observation.times - observation.times[0]
    first = max(int(np.searchsorted(times, SETTLING * PATIENCE)), round(LOOKED_AT * len(times)))
    first = max(1, min(first, len(times) // 2))
    state, observer = State(places, torch.zeros_like(places)), Observer(observation, made, PATIENCE)
    return Transferred(twin, state, observer, first, {}, noise_of(observation))


def _world_there(study: Study, twin: PlainTwin) -> World:
    """Of a twin as it is laid there, with the parameters of the first recording."""
    plain = replace(study.plain, twin=twin)
    return plain.at({name: study.base.values.get(name, q.start) for name, q in plain.quantities.items()})


def _say_idle(twin: PlainTwin, world: World) -> None:
    """Warn of effects that the twin carries and that have nothing to act on there."""
    for name in idle(world, twin.carried):
        warnings.warn(
            f"{name}, which the twin carries, cannot act in the other recording: it is left out",
            stacklevel=4,
        )


def _own(study: Study, plain: Hypothesis, other: Transferred) -> Mapping[str, float]:
    """How a hand holds the object there, and how much that is at rest, as the plain twin finds it."""
    usual = {name: study.base.values.get(name, quantity.start) for name, quantity in plain.quantities.items()}
    names = [name for name in plain.quantities if name.startswith(RECORDINGS_OWN)]
    # what the first recording has no ground or no grip to tell is not known of the object either
    names += [name for name in plain.quantities if name not in study.base.values and name not in names]
    if plain.twin.hand_known or other.first < LEAST_FRAMES:
        return {}
    return other.held(plain, usual, names)


def _sure(
    here: Float64[Array, "N 3"], there: Float64[Array, "N 3"], before: Observation, after: Observation
) -> tuple[Float64[Array, "N 3"], Float64[Array, "N 3"]]:
    """Places in the first frames of what is seen there; what is not may have been taken for somewhere else.

    As they are, where too few are seen in both.
    """
    first, other = _seen_at_first(here, before), _seen_at_first(there, after)
    both = _known_in_both(first, other)
    enough = both >= max(FEWEST, SEEN * _known_in_both(here, there))
    return (first, other) if enough else (here, there)


def _seen_at_first(places: Float64[Array, "N 3"], observation: Observation) -> Float64[Array, "N 3"]:
    seen = np.isfinite(observation.points[0, :, 0])
    return np.where(seen[:, None], places, np.nan) if seen.sum() >= FEWEST else places


def _known_in_both(here: Float64[Array, "N 3"], there: Float64[Array, "N 3"]) -> int:
    return int((np.isfinite(here[:, 0]) & np.isfinite(there[:, 0])).sum())


def _told_there(
    body: Body, here: Float64[Array, "N 3"], there: Float64[Array, "N 3"], points: Float64[Array, "P 3"]
) -> Body:
    """The body, of which points that were never seen in the first recording are where the other shows them.

    Args:
        body: Of the first recording.
        here: Places of the observed points in its first frame [m]; NaN: never seen.
        there: The same of the other recording.
        points: Mass points in the other recording's first frame [m].
    """
    new = np.isnan(here[:, 0]) & np.isfinite(there[:, 0])
    if not new.any():
        return body
    index, weight = body.index.copy(), body.weight.copy()
    index[new], weight[new] = between(there[new], points)
    return replace(body, index=index, weight=weight)


def _held_alike(
    twin: PlainTwin, before: Observation, after: Observation, points: Float64[Array, "P 3"]
) -> PlainTwin | None:
    """Held by the springs of a given twin's own hand, where the hand is where it was; else None."""
    hand, own = after.controllers[0].astype(np.float64), before.controllers[0].astype(np.float64)
    if not twin.hand_known or hand.shape != own.shape or not len(twin.body.grip):
        return None
    if len(own) != twin.controls.shape[1]:
        return None  # its controllers only go with those of the recording, and nobody sees them here
    apart = np.linalg.norm(hand[twin.body.grip[:, 0]] - points[twin.body.grip[:, 1]], axis=1)
    first = np.linalg.norm(own[twin.body.grip[:, 0]] - twin.body.points[twin.body.grip[:, 1]], axis=1)
    if np.abs(apart - first).max() > SAME_HAND * twin.body.grasp:
        return None
    return replace(twin, observation=after, controls=steadied(after.controllers, after.times))


def _held_anew(
    twin: PlainTwin, observation: Observation, seen: Float64[Array, "N 3"], points: Float64[Array, "P 3"]
) -> PlainTwin:
    """Held where the hand is now, with the material that it has."""
    grip = _grip(twin.body, observation, seen, points)
    found = PlainTwin.of(replace(twin.body, points=points, grip=grip), observation)
    own = twin.matter
    matter = replace(
        own,
        start={**found.matter.start, **own.start},
        grip_pattern=found.matter.grip_pattern,
        grip_length=found.matter.grip_length,
        hold=found.matter.hold,
    )
    heavier = float(own.mass.sum() / found.matter.mass.sum())
    rest = replace(twin.rest, supports=heavier * found.rest.supports, around=found.rest.within)
    if twin.body.shape != "rope" and not twin.given:
        matter = replace(matter, length=found.matter.length)
        rest = replace(rest, tensions=heavier * found.rest.tensions, within=found.rest.within)
    return replace(
        twin,
        body=replace(found.body, points=twin.body.points),
        observation=observation,
        matter=matter,
        rest=rest,
        controls=found.controls,
    )


def _grip(
    body: Body, observation: Observation, seen: Float64[Array, "N 3"], points: Float64[Array, "P 3"]
) -> Int64[Array, "S 2"]:
    """Every controller holds the points within its reach, and one that leads the body the nearest to it.

    The end that it holds may be nearer to it than it is known to be: what neither recording shows of it is
    where its neighbours are.

    Args:
        body: Of the first recording.
        observation: The other recording.
        seen: Where the observed points are in its first frame [m]; NaN for those that are never seen.
        points: Where the mass points are there [m].
    """
    controllers = observation.controllers[0].astype(np.float64)
    near = grip_of(points, controllers, body.grasp)
    leading = np.flatnonzero(hiding(points, seen, observation, body.spacing))
    far = np.setdiff1d(leading, near[:, 0])
    nearest = cKDTree(points).query(controllers[far])[1]
    return np.concatenate([near, np.stack([far, nearest], axis=1)]).astype(np.int64)
