"""Where the gap lies: in which points, frames, parts and phases a fitted plain twin predicts wrongly."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float64, Int64

from model.gap.bodies.first import first_places
from model.gap.coherence import Coherence, carried_noise, discoveries
from model.gap.estimate import Estimate
from model.gap.phases import Phase, phases
from model.gap.regions import parts_of
from model.gap.schema import PartShare, PhaseShare
from model.gap.study import Study
from model.simulator.divergence import SimulationDiverged
from model.types import Array


@dataclass(frozen=True)
class Located:
    """Shares of the gap; those of points, of frames, of parts and of phases each sum to 1."""

    points: Float64[Array, " N"]
    frames: Float64[Array, " T"]
    parts: tuple[PartShare, ...]
    phases: tuple[PhaseShare, ...]
    chance: float
    """Of noise alone having as much in the part and phase that stand out most."""
    warnings: tuple[str, ...]


def locate(study: Study, left: Estimate) -> Located:
    """Where a fitted plain twin, led by an observer, predicts worse than noise explains, in all frames.

    The gap of a point in a frame is the square of its innovation less the noise, taken as the product with
    the innovations of points near it (`Coherence`). Its mean over what is seen, never below zero, is the
    share of a point, a frame, a part or a phase. Where no part stands out of the noise in any phase, nothing
    is located: all shares are even, and a warning says so.

    Args:
        study: What was seen, and its observer.
        left: What leaves the gap: the fit, or the refit, of the plain twin.
    """
    observation, body = study.observation, study.plain.twin.body
    innovations, lost = _innovations(study, left)
    seen = np.isfinite(observation.points[..., 0])
    seen[0] = False
    seen[len(innovations) :] = False
    padded = np.zeros((*seen.shape, 3))
    padded[: len(innovations)] = innovations
    places = first_places(observation)
    places = np.where(np.isfinite(places), places, np.nanmean(places, axis=0))
    carried = carried_noise(study.observer.patience, float(np.median(np.diff(observation.times))))
    coherence = Coherence.of(padded, seen, places, body, carried)
    spans = phases(observation)
    names, part = parts_of(observation, body)
    chances, chance = coherence.chances(body, part, _phase_of_frame(spans))
    warnings: tuple[str, ...] = (lost,) if lost else ()
    energy, counted = coherence.energy(), coherence.counted()
    if discoveries(chances).any():
        points, frames = _shares(energy, counted, 0), _shares(energy, counted, 1)
    else:
        warnings += (_nowhere(chance),)
        points, frames = _even(part.shape[0]), _even(len(observation.times))
    return Located(
        points,
        frames,
        tuple(
            PartShare(part=name, share=min(float(points[part == i].sum()), 1.0))
            for i, name in enumerate(names)
        ),
        tuple(_phase_share(span, frames) for span in spans),
        chance,
        warnings,
    )


def _innovations(study: Study, left: Estimate) -> tuple[Float64[Array, "F N 3"], str]:
    """Innovations over noise of the fitted twin in all frames, or in those it was fitted to."""
    world = study.plain.at(left.values)
    observer = study.observer
    try:
        with torch.no_grad():
            predicted = observer.lead(world).predicted
    except SimulationDiverged:
        lost = "the fitted twin becomes unstable: the gap is located in the frames it was fitted to only"
        return study.residuals(left), lost
    error = observer.bounded((observer.places - predicted).double()).numpy()
    return error * observer.seen.numpy()[..., None] / study.misfit.noise, ""


def _shares(energy: Float64[Array, "T N"], counted: Array, axis: int) -> Float64[Array, " k"]:
    """Of the sum over the other axis, as if all was seen."""
    mean = (energy * counted).sum(axis) / np.maximum(counted.sum(axis), 1)
    above = np.maximum(mean, 0.0)
    total = float(above.sum())
    return above / total if total > 0 else _even(len(above))


def _even(count: int) -> Float64[Array, " k"]:
    return np.full(count, 1.0 / count)


def _phase_of_frame(spans: tuple[Phase, ...]) -> Int64[Array, " T"]:
    return np.concatenate([np.full(span.end - span.first, i, np.int64) for i, span in enumerate(spans)])


def _phase_share(span: Phase, frames: Float64[Array, " T"]) -> PhaseShare:
    share = float(frames[span.first : span.end].sum())
    return PhaseShare(name=span.name, start_s=span.start_s, end_s=span.end_s, share=min(share, 1.0))


def _nowhere(chance: float) -> str:
    return f"where the gap lies cannot be told: it stands out of the noise nowhere (p = {chance:.2g})"
