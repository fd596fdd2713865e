"""How well a world foretells what was seen: it is led up to a frame, and then runs free."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float64

from model.gap.misfit import FINER
from model.gap.observer import Observer
from model.gap.world import World
from model.simulator.divergence import SimulationDiverged
from model.simulator.system import State
from model.types import Array

WINDOW = 0.7
"""Free runs last about as long [s]. Soft bodies that swing are nearly chaotic: after seconds of running free
a small error of the start is as large as any missing physics, and wrong twins cannot be told apart."""


@dataclass(frozen=True)
class Forecast:
    """What a world foretold of F frames, the last of T."""

    first: int
    """The first of these frames."""
    points: Float64[Array, "F N 3"]
    """Where the points were expected by free runs [m]; NaN where a run was lost."""
    distance: Float64[Array, "F N"]
    """How far from there they were seen [m]; NaN where they were not."""
    innovations: Float64[Array, "T N 3"]
    """Of the led run over all frames, one frame ahead: expected less seen [m]; zero where not seen."""

    @property
    def error(self) -> float:
        """Mean distance of visible points [m]."""
        return float(np.nanmean(self.distance))

    @property
    def of_frames(self) -> Float64[Array, " F"]:
        """Mean distance of visible points per frame [m]; NaN where nothing is seen."""
        counts = np.isfinite(self.distance).sum(1)
        mean: Float64[Array, " F"] = np.nansum(self.distance, 1) / np.where(counts, counts, np.nan)
        return mean


def windows(times: Float64[Array, " T"], first: int) -> list[int]:
    """Last frames that are looked at before free runs, which cover the frames from `first` on, each once."""
    start = first - 1
    count = max(1, round(float(times[-1] - times[start]) / WINDOW))
    begins = np.linspace(times[start], times[-1], count + 1)[:-1]
    return sorted({int(np.abs(times[start:-1] - begin).argmin()) + start for begin in begins})


def forecast(observer: Observer, world: World, first: int, state: State | None = None) -> Forecast:
    """Lead a world through all frames, and let it run free over windows from `first` on.

    Each window starts in the state that the observer has come to, with nothing seen after that; parameters
    are as given throughout.

    Args:
        observer: Of the observation.
        world: One world.
        first: Frame from which to foretell, at least 1.
        state: At frame 0; None: at rest.
    """
    starts = windows(world.times, first)
    seen = observer.seen.numpy()
    with torch.no_grad():
        substeps = observer.substeps(world, state)
        # a twin that is right must not be lost to its time steps
        for times in (1, *FINER):
            expected, free, lost = _led(observer, world, starts, state, times * substeps)
            if not lost:
                break
    places = observer.places.double().numpy()
    distance = np.linalg.norm(free - places, axis=-1)
    distance = np.where(np.isfinite(distance), np.minimum(distance, observer.lost), observer.lost)
    return Forecast(
        first,
        free[first:],
        np.where(seen, distance, np.nan)[first:],
        _bounded(expected - places, seen, observer.lost),
    )


def _led(
    observer: Observer, world: World, starts: list[int], state: State | None, substeps: int
) -> tuple[Float64[Array, "T N 3"], Float64[Array, "T N 3"], bool]:
    """Where the points were expected one frame ahead, and by free runs [m]; whether any of that was lost."""
    expected = np.full(observer.places.shape, np.nan)
    free = expected.copy()
    ends = [*starts, len(world.times) - 1]
    now, begin, lost = state, 0, False
    for i, end in enumerate(ends):
        try:
            led = observer.lead(world, now, begin, end, substeps=substeps)
        except SimulationDiverged:
            return expected, free, True
        expected[begin + 1 : end + 1] = led.predicted[1:].numpy()
        now, begin = led.rollout.end, end
        if end != ends[-1]:
            try:
                run = observer.lead(world, now, end, ends[i + 1], until=end, substeps=substeps)
            except SimulationDiverged:
                lost = True
            else:
                free[end + 1 : ends[i + 1] + 1] = run.predicted[1:].double().numpy()
    return expected, free, lost


def _bounded(
    innovations: Float64[Array, "T N 3"], seen: Bool[Array, "T N"], lost: float
) -> Float64[Array, "T N 3"]:
    """Zero where nothing was seen and in the first frame, `lost` [m] where the run was."""
    kept: Float64[Array, "T N 3"] = np.clip(np.nan_to_num(innovations, nan=lost), -lost, lost)
    kept *= seen[..., None]
    kept[0] = 0.0
    return kept
