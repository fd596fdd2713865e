"""What the gap of a twin as it came is made of: camera, hand, parameters, missing physics, and the rest."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float64, Int64
from torch import Tensor

from model.gap.belief import LOOSE
from model.gap.bodies.first import first_places
from model.gap.effects.actuation_delay import ActuationDelay
from model.gap.effects.base import Quantity
from model.gap.estimate import Estimate
from model.gap.hypothesis import Hypothesis
from model.gap.misfit import Misfit
from model.gap.observer import Observer
from model.gap.schema import Closure, Sources
from model.gap.study import Study
from model.gap.world import World
from model.types import Array, Observation

BLOCKS = 5
"""Of time: what is fitted on four of them has to explain the fifth."""
DELAY, GAIN, OFFSET = 0.02, 0.03, 0.005
"""Usual sizes of what a hand errs by: [s], of its way, [m]."""
SCALE, DRIFT = 0.02, 0.01
"""Usual sizes of what a camera errs by: of the way of the whole object, [m] by the last frame."""


def sources(
    closure: Closure, study: Study, hypothesis: Hypothesis, left: Estimate, first: float | None = None
) -> Sources:
    """Shares of the squared gap of the twin as it came, on held-out time.

    With E the errors of `closure`, each no larger than the one before:

    - parameters: E² of the baseline less E² of the refit;
    - physics: that less E² with the effect; of an effect of the hand it is counted as actuation. Of two
      effects the first has what it takes away alone, the second the rest;
    - perception: E² of the noise floor;
    - what is left between effect and floor is perception as far as a wrong scale of the object's way or a
      slow drift would explain it, actuation as far as a delay, a gain or an offset of the hand would, and
      unexplained for the rest. How far is told by a linear test, the other parameters free to follow: what
      is fitted on four blocks of time has to explain the fifth. A hand that goes too far and an object that
      is seen to go too far are hard to tell apart; what both explain is halved.

    The ceiling is not used: a flexible force makes up for errors of hand and camera as well.

    Args:
        closure: Errors on held-out time.
        study: The plain twin, fitted.
        hypothesis: With the verdict's effects, the first one first, where they act; or the plain twin.
        left: What leaves the rest: its fit.
        first: E with the first of two effects alone [m].
    """
    refit = min(closure.refit, closure.baseline)
    with_effect = refit if closure.with_effect is None else min(closure.with_effect, refit)
    floor = min(closure.noise_floor, with_effect)
    whole = closure.baseline**2
    if whole <= 0:
        return Sources(perception=1.0, actuation=0.0, parameters=0.0, physics=0.0, unexplained=0.0)
    named = (refit**2 - with_effect**2) / whole
    rest = (with_effect**2 - floor**2) / whole
    seen, moved = _explained(study, hypothesis, left) if rest > 0 else (0.0, 0.0)
    between = with_effect if first is None else min(max(first, with_effect), refit)
    each = (refit**2 - between**2) / whole, (between**2 - with_effect**2) / whole
    by_hand = sum(
        share for share, effect in zip(each, hypothesis.effects, strict=False) if effect.acts == "hand"
    )
    found = {
        "perception": floor**2 / whole + seen * rest,
        "actuation": moved * rest + by_hand,
        "parameters": 1.0 - refit**2 / whole,
        "physics": named - by_hand,
    }
    shares = {name: float(np.clip(share, 0.0, 1.0)) for name, share in found.items()}
    return Sources(**shares, unexplained=float(np.clip(1.0 - sum(shares.values()), 0.0, 1.0)))


@dataclass(frozen=True, kw_only=True)
class Misled(Hypothesis):
    """Fixed values, as a function of what the hand errs by."""

    @property
    def quantities(self) -> dict[str, Quantity]:
        """Errors of the hand, each from what it is not there."""
        metres = {f"offset_{axis}": Quantity("m", (-OFFSET, OFFSET), 0.0) for axis in "xyz"}
        return {
            "delay": Quantity("s", (-DELAY, DELAY), 0.0),
            "gain": Quantity("1", (-GAIN, GAIN), 0.0),
            **metres,
        }

    @property
    def together(self) -> bool:
        """One at a time."""
        return False

    def __call__(self, values: Mapping[str, Tensor]) -> World:
        """The world in which the hand errs so."""
        one = {name: value.reshape(()) for name, value in values.items()}
        world = Hypothesis(self.twin, self.effects, None, self.where).at(dict(self.held or {}))
        world = ActuationDelay().apply(world, {"delay": one["delay"]})
        assert world.controls is not None
        start = world.controls[:1]
        offset = torch.stack([one[f"offset_{axis}"] for axis in "xyz"]).to(start)
        moved = start + (1.0 + one["gain"].to(start)) * (world.controls - start)
        # it is where it was said to be in the first frame: the body was built around it
        moved = torch.cat([moved[:1], moved[1:] + offset])
        return replace(world, controls=moved)


def _explained(study: Study, hypothesis: Hypothesis, left: Estimate) -> tuple[float, float]:
    """Shares, of what is left above the noise, that errors of the camera and of the hand explain."""
    at = Misfit(hypothesis, study.observer, study.misfit.span, study.misfit.noise)
    residuals = at(left.vector[None])[0]
    camera = _camera_ways(study, hypothesis, left, residuals)
    hand = _hand_ways(study, hypothesis, left)
    blocks = BLOCKS * study.frame_of_residuals() // study.split

    def gain(ways: Float64[Array, "m k"]) -> float:
        return before - _left(left.jacobian, ways, residuals, blocks)

    before = _left(left.jacobian, camera[:, :0], residuals, blocks)
    excess = before - len(residuals)
    if excess <= 0:
        return 0.0, 0.0
    by_camera, by_hand = max(gain(camera), 0.0), max(gain(hand), 0.0)
    both = max(gain(np.concatenate([camera, hand], 1)), by_camera, by_hand)
    shared = 0.5 * max(by_camera + by_hand - both, 0.0)
    shares = np.clip(np.array([by_camera - shared, by_hand - shared]) / excess, 0.0, 1.0)
    shares = shares / max(float(shares.sum()), 1.0)
    return float(shares[0]), float(shares[1])


def _hand_ways(study: Study, hypothesis: Hypothesis, left: Estimate) -> Float64[Array, "m k"]:
    """What usual errors of the hand change in the residuals; none where nothing is held."""
    if not len(study.plain.twin.body.grip):
        return np.zeros((len(left.residuals), 0))
    misled = Misled(hypothesis.twin, hypothesis.effects, left.values, hypothesis.where)
    misfit = study.misfit.of(misled)
    count = len(misfit.coordinates.names)
    # coordinates are quarters of the bounds, which reach from minus to plus the usual size
    return misfit.jacobian(np.zeros(count), 0.5) * 2.0


def _camera_ways(
    study: Study, hypothesis: Hypothesis, left: Estimate, residuals: Float64[Array, " m"]
) -> Float64[Array, "m k"]:
    """What usual errors of the camera change in the residuals."""
    observation = study.observation
    world = hypothesis.at(left.values)
    share = (observation.times - observation.times[0]) / (observation.times[-1] - observation.times[0])
    drifts = [DRIFT * share[:, None] * axis for axis in np.eye(3)]
    ways = []
    for moved in (SCALE * _way(observation), *drifts):
        points = observation.points + moved[:, None].astype(np.float32)
        observer = Observer(replace(observation, points=points), world, study.observer.patience)
        misfit = Misfit(hypothesis, observer, study.misfit.span, study.misfit.noise)
        ways.append(misfit(left.vector[None])[0] - residuals)
    return np.stack(ways, 1)


def _way(observation: Observation) -> Float64[Array, "T 3"]:
    """How far the object as a whole has moved since the first frame [m]."""
    moved = observation.points.astype(np.float64) - first_places(observation)
    seen = np.isfinite(moved[..., :1])
    total = np.where(seen, moved, 0.0).sum(1) / np.maximum(seen.sum(1), 1)
    way: Float64[Array, "T 3"] = total
    return way


def _left(
    jacobian: Float64[Array, "m d"],
    ways: Float64[Array, "m k"],
    residuals: Float64[Array, " m"],
    blocks: Int64[Array, " m"],
) -> float:
    """Squares left in blocks of time by what is fitted to the other blocks."""
    columns = np.concatenate([jacobian, ways], 1)
    prior = np.diag(np.concatenate([np.full(jacobian.shape[1], LOOSE**-2), np.ones(ways.shape[1])]))
    total = 0.0
    for b in range(BLOCKS):
        kept = blocks != b
        fitted = columns[kept].T @ columns[kept] + prior
        size = np.linalg.solve(fitted, -columns[kept].T @ residuals[kept])
        total += float(((residuals[~kept] + columns[~kept] @ size) ** 2).sum())
    return total
