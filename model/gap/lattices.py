"""What a twin would leave of itself on other lattices: how much of a gap tells of nothing but the lattice.

No lattice is the world. Where a cloth wrinkles, a block tips over or a cable whips, twins that are the same
thing on another lattice go elsewhere, and one follows the other as badly as it follows the world; where an
object just hangs they go together within the noise. How much it is in a recording is asked of the twin: it
moves as fitted, on other lattices, and is then followed as if that had been seen.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch

from model.errors import InputError
from model.gap.account import against_ordinary
from model.gap.bodies.body import Body, body_of
from model.gap.hypothesis import Hypothesis
from model.gap.misfit import Misfit
from model.gap.observer import Observer
from model.gap.plain import PlainTwin
from model.gap.side_by_side import side_by_side
from model.gap.study import Study
from model.gap.transfer import Followed, Transferred, laid_there
from model.simulator.divergence import SimulationDiverged
from model.simulator.system import State

FINER = {"rope": 0.85, "sheet": 0.75, "solid": 0.85}
COARSER = 1.18
"""Spacings of the two other lattices over the twin's."""
LESS_CALM = {"bending_decay": 0.05}
"""In a finer net zigzags die out so much more slowly. That they do is no property of a cloth: a fit likes
nets that are calm, and two of these go together where cloths do not."""
DIMENSIONS = {"rope": 1, "sheet": 2, "solid": 3}


@dataclass(frozen=True)
class Lattice:
    """The plain twin on another lattice."""

    hypothesis: Hypothesis
    own: Body
    """The lattice that it is another one than."""
    factors: Mapping[str, float]
    """Of quantities that are not those of the same object, but of its lattice."""
    state: State | None = None
    """In the first frame; None: at rest."""

    def values(self, values: Mapping[str, float]) -> dict[str, float]:
        """With which it is the same object.

        Args:
            values: Of the twin on its own lattice.
        """
        same = same_object(values, self.hypothesis, self.own)
        return {name: self.factors.get(name, 1.0) * value for name, value in same.items()}


def lattices_of(study: Study) -> list[Lattice]:
    """The twin of a study on other lattices; none of one that was given, which has the one that it came with.

    Args:
        study: Its twin and its recording.
    """
    twin = study.plain.twin
    own = twin.body
    if twin.given:
        return []

    def lattice(scale: float, factors: Mapping[str, float]) -> Lattice:
        body = body_of(study.observation, own.shape, scale)
        other = replace(PlainTwin.of(body, study.observation), along=own)
        return Lattice(replace(study.plain, twin=other), own, factors)

    return [lattice(FINER[own.shape], LESS_CALM if own.shape == "sheet" else {}), lattice(COARSER, {})]


def left_here(lattices: Sequence[Lattice], misfit: Misfit, values: Mapping[str, float]) -> float | None:
    """What the plain twin leaves in the frames of its fit of itself on other lattices, over the noise.

    Args:
        lattices: From `lattices_of`.
        misfit: Of the plain twin, as it was fitted.
        values: Of its own parameters.

    Returns:
        Mean square over that of the noise, told as `Account.left` is, on average over lattices; None: there
        is none that can be told.
    """
    left = side_by_side(lambda one: _left_of(misfit, values, one), lattices)
    told = [one for one in left if one is not None]
    return against_ordinary(float(np.mean(told)), misfit.noise) if told else None


def left_there(
    lattices: Sequence[Lattice],
    study: Study,
    other: Transferred,
    values: Mapping[str, float],
    found: Followed,
) -> float | None:
    """The same in all frames of the other recording.

    Args:
        lattices: Of the first recording.
        study: Of that, whose object it is.
        other: The other one.
        values: Of the plain twin's own parameters in the first.
        found: The plain twin fitted to the other.
    """
    laid = []
    for one in lattices:
        base = replace(study.base, values=one.values(values))
        try:
            with warnings.catch_warnings():
                # what is doubtful of where it lies was said of the twin's own lattice
                warnings.simplefilter("ignore")
                there = laid_there(replace(study, plain=one.hypothesis, base=base), other.twin.observation)
        except InputError:
            # that is told by its points, and those of this lattice may not tell it
            continue
        laid.append(replace(one, hypothesis=there.hypothesis(one.hypothesis), state=there.state))
    return left_here(laid, found.misfit, found.estimate.values)


def same_object(values: Mapping[str, float], hypothesis: Hypothesis, body: Body) -> dict[str, float]:
    """Values with which a twin on another lattice is as stiff and as damped, and held as far around a hand.

    Of springs k [N/m] that are h long a line has the modulus k h, a plane k and a body k / h, so k goes by
    the spacing to the power of the dimension less two; and so do its dashpots, `damping` times √(k m).

    Args:
        values: Of the twin on its own lattice.
        hypothesis: On the other.
        body: The own lattice.
    """
    other = hypothesis.twin.body
    finer = other.spacing / body.spacing
    factors = {
        "stiffness": finer ** (DIMENSIONS[body.shape] - 2),
        "damping": 1.0 / finer,
        "reach": body.grasp / other.grasp,
    }
    return {
        name: factors.get(name, 1.0) * values[name] if name in values else quantity.start
        for name, quantity in hypothesis.quantities.items()
    }


def _left_of(misfit: Misfit, values: Mapping[str, float], lattice: Lattice) -> float | None:
    """Of one of them; None: it is lost to its time steps."""
    hypothesis, span = misfit.hypothesis, misfit.span
    observation = hypothesis.twin.observation
    try:
        with torch.no_grad():
            world = lattice.hypothesis.at(lattice.values(values))
            substeps = misfit.observer.substeps(world, lattice.state)
            rollout = world.rollout(lattice.state, last=span.last, substeps=substeps)
            moved = world.sight(rollout.points.to(world.system.points)).numpy()
    except SimulationDiverged:
        return None
    points = np.full_like(observation.points, np.nan)
    points[: span.last + 1] = np.where(np.isfinite(observation.points[: span.last + 1]), moved, np.nan)
    seen = replace(observation, points=points)
    observer = Observer(seen, hypothesis.at(values), misfit.observer.patience)
    followed = misfit.through(observer, span)
    return float((followed(misfit.coordinates.vector(dict(values))[None]) ** 2).mean())
