"""How noisy an observation is."""

import math
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from model.gap.bodies.first import first_places
from model.types import Array, Observation

NEIGHBOURS, CANDIDATES = 3, 12
"""Neighbours whose motion is taken off, the nearest that are seen of so many."""
STRIDES = (2, 3, 4, 6)
"""Frames between the places of a third difference by which the noise's memory is told, besides 1."""
MIDDLE = 1.5382
"""Median length of a vector of three independent normal numbers of variance 1."""
ENOUGH, FEW = 100, 10
"""Third differences by which memory is told, and by which there is a noise at all."""
LONGEST = 0.85
"""Memory per frame beyond which noise is too slow to be told from motion."""
DOUBLE = 2.2
"""Times that the square of noise at stride 1 is at stride 2, at most, by its law 2: more is motion."""
ROUNDING = 1.0 + 1e-9
NEAREST = 0.25
"""Share of the sightings, the nearest in time, that are asked where no others are."""
QUIETEST = 5e-5
"""No measurement is less noisy than this [m]."""
UNKNOWN = 1e-3
"""Of an ordinary sensor [m]: of one of which nothing is known."""


def noise_of(observation: Observation) -> float:
    r"""Standard deviation of the measured places [m], from third differences in time, less the neighbours'.

    Motion that is smooth over four frames, or that neighbours share, drops out. Of noise of standard
    deviation σ that is correlated by m from frame to frame, differences over s frames leave
    $\sigma^2 (20 - 30 m^s + 12 m^{2s} - 2 m^{3s})$: how they grow with s tells m. Motion grows faster, and
    would pass for memory, so the memory is the longest that exceeds at no s what was measured. It is at least
    none, which is the least noise for given differences.

    Where no point is seen in four frames in a row, sightings that are apart are asked, as if the noise had no
    memory.
    """
    points = observation.points.astype(np.float64)
    near = _near(observation)
    single = _squared(points, near, 1, FEW)
    if single is None:
        return max(_of_sightings(points, observation.times), QUIETEST)
    longer = {stride: _squared(points, near, stride, ENOUGH) for stride in STRIDES}
    known = {stride: square for stride, square in longer.items() if square is not None}
    return max(math.sqrt(_variance(single, known)), QUIETEST)


def _near(observation: Observation) -> Int64[Array, "N k"]:
    """Points next to each, the nearest first."""
    places = np.nan_to_num(first_places(observation), nan=1e3)
    count = min(CANDIDATES, len(places) - 1)
    if count < 1:
        return np.zeros((len(places), 0), np.int64)
    near: Int64[Array, "N k"] = cKDTree(places).query(places, k=count + 1)[1][:, 1:].astype(np.int64)
    return near


def _squared(
    points: Float64[Array, "T N 3"], near: Int64[Array, "N k"], stride: int, least: int
) -> float | None:
    """Mean square of a coordinate's third difference over `stride` frames [m²]; None: fewer than `least`.

    The mean of those neighbours that are there is taken off, which adds its own noise. Where few have any,
    the differences are taken as they are.
    """
    if len(points) <= 3 * stride:
        return None
    s = stride
    third = points[3 * s :] - 3.0 * points[2 * s : -s] + 3.0 * points[s : -2 * s] - points[: -3 * s]
    there = np.isfinite(third[..., 0])
    if there.sum() < least:
        return None
    known, around, count = np.nan_to_num(third), np.zeros_like(third), np.zeros(there.shape, np.int64)
    for one in near.T:
        used = there[:, one] & (count < NEIGHBOURS)
        around += np.where(used[..., None], known[:, one], 0.0)
        count += used
    accompanied = there & (count > 0)
    if accompanied.sum() >= min(ENOUGH, int(there.sum()) // 2):
        beside = count[accompanied][:, None]
        left = (third[accompanied] - around[accompanied] / beside) / np.sqrt(1.0 + 1.0 / beside)
    else:
        left = third[there]
    return _mean_square(left)


def _mean_square(vectors: Float64[Array, "n 3"]) -> float:
    """Of a coordinate, by the median length: the same in a turned world, as no coordinate's is."""
    return (float(np.median(np.linalg.norm(vectors, axis=1))) / MIDDLE) ** 2


def _variance(single: float, longer: Mapping[int, float]) -> float:
    """Of the noise [m²], from mean squares of third differences over one frame, and over more by stride."""
    white = single / 20.0
    if longer.get(2, math.inf) > DOUBLE * single:
        return white
    memory = np.linspace(0.0, LONGEST, 1 + round(200 * LONGEST))
    growth = {stride: _factor(memory**stride) / _factor(memory) for stride in longer}
    motion = np.zeros_like(memory)
    if 3 in longer:
        # smooth motion leaves s³ times as much over s frames: what is left over three tells how much over one
        motion = np.maximum((longer[3] - growth[3] * single) / (3.0**6 - growth[3]), 0.0)
    possible = growth[2] * (single - motion) + 2.0**6 * motion <= longer[2] * ROUNDING
    for stride, square in longer.items():
        possible &= growth[stride] * single <= square * ROUNDING
    if not possible.any():
        return white
    last = int(np.flatnonzero(possible)[-1])
    return max(white, (single - float(motion[last])) / float(_factor(memory)[last]))


def _factor(memory: Array) -> Array:
    """Variance of a third difference over that of noise which keeps so much from one place to the next."""
    factor: Array = 20.0 - 30.0 * memory + 12.0 * memory**2 - 2.0 * memory**3
    return factor


def _of_sightings(points: Float64[Array, "T N 3"], times: Float64[Array, " T"]) -> float:
    """From four sightings of a point one after the other, however far apart [m]."""
    left, spans = [], []
    for track in points.swapaxes(0, 1):
        seen = np.flatnonzero(np.isfinite(track[:, 0]))
        for four in np.lib.stride_tricks.sliding_window_view(seen, 4) if len(seen) > 3 else []:
            apart = times[four, None] - times[four] + np.eye(4)
            weight = 1.0 / apart.prod(1)
            left.append(weight @ track[four] / np.linalg.norm(weight))
            spans.append(times[four[-1]] - times[four[0]])
    if not left:
        return UNKNOWN
    nearest = np.array(spans) <= np.quantile(spans, NEAREST)
    return math.sqrt(_mean_square(np.stack(left)[nearest]))
