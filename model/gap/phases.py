"""The phases of a motion: what the hand and the ground do to the object, from the observation alone."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial import cKDTree

from model.gap.bodies.first import first_places
from model.gap.bodies.neighbours import usual_distance
from model.gap.noise import noise_of
from model.types import Array, Observation

SHORTEST = 0.15
"""No phase is shorter [s], unless the motion is."""
MOST = 12
"""Phases; beyond that the shortest join their neighbours."""
SMOOTH = 0.17
"""Window of means over time [s], before speeds are taken."""
STILL = 0.03
"""A hand slower than this is held still [m/s], and one that is much slower than it usually is."""
USUAL = 0.15
"""Of the speed that a hand seldom exceeds: below it, it is held still."""
REST = 0.02
"""Points slower than this lie still [m/s]."""
STRETCHING = 0.1
"""A body lengthens or shortens faster than this [1/s] when it is stretched or let back."""
STEEP = 0.8
"""A motion is up or down where this share of it is vertical."""
REACH = 1.5
"""A hand holds the object while it is at most so many spacings farther from it than at first."""
NEAR = 6.0
"""A hand that is more spacings away at first does not hold it."""
PAIRS = 12
"""Neighbours of a point from which its stretch is told."""


@dataclass(frozen=True)
class Phase:
    """Part of a motion; the phases of a motion divide it."""

    name: str
    first: int
    """Frame it begins with."""
    end: int
    """Frame after its last."""
    start_s: float
    end_s: float


def phases(observation: Observation) -> tuple[Phase, ...]:
    """Divide a motion by what the hand does - lift, lower, stretch, hold still, let go - and the ground.

    Told from the speed of the controllers, their distance to the object, the distances of points that are
    near each other at first, and heights above the ground.

    Args:
        observation: What really moved.
    """
    times = observation.times
    names = _named(observation)
    cuts = [0, *(i for i in range(1, len(names)) if names[i] != names[i - 1]), len(names)]
    pieces = _merged([(names[i], i, j) for i, j in pairwise(cuts)], times)
    return tuple(
        Phase(name, i, j, float(times[i]), float(times[min(j, len(times) - 1)])) for name, i, j in pieces
    )


def _named(observation: Observation) -> list[str]:
    """What happens in each frame."""
    motion = _Motion.of(observation)
    moving, vertical = motion.hand()
    rate, held, touching = motion.stretching(), motion.held(), motion.touching()
    still = motion.still()
    names = []
    for t in range(len(observation.times)):
        if held[t]:
            name = _handled(bool(moving[t]), float(vertical[t]), float(rate[t]))
            names.append(f"{name}, touching the ground" if touching[t] else name)
        elif touching[t]:
            names.append("lying on the ground" if still[t] else "moving on the ground")
        else:
            names.append("free")
    return names


def _handled(moving: bool, vertical: float, rate: float) -> str:
    if moving and abs(rate) > STRETCHING:
        return "stretched" if rate > 0 else "let back"
    if not moving:
        return "held still"
    return "carried" if abs(vertical) < STEEP else "lifted" if vertical > 0 else "lowered"


@dataclass(frozen=True)
class _Motion:
    """Smooth places of object and hand."""

    observation: Observation
    points: Float64[Array, "T N 3"]
    """[m], between frames in which a point is seen on a line; only points that are ever seen."""
    known: Bool[Array, "T N"]
    """Where they are not made up: not before a point is first seen, nor after it is last seen."""
    places: Float64[Array, "N 3"]
    """In the first frame [m], of those that are not seen there by their neighbours."""
    hands: Float64[Array, "T C 3"]
    spacing: float
    noise: float

    @classmethod
    def of(cls, observation: Observation) -> "_Motion":
        points = observation.points.astype(np.float64)
        ever = np.isfinite(points[..., 0]).any(0)
        times = observation.times
        filled = np.stack([_filled(points[:, i], times) for i in np.flatnonzero(ever)], 1)
        places = first_places(observation)[ever]
        spacing = usual_distance(places) if len(places) > 1 else 0.0
        hands = _smooth(observation.controllers.astype(np.float64), times)
        known = _known(np.isfinite(points[:, ever, 0]), _half(times) + 1)
        return cls(observation, _smooth(filled, times), known, places, hands, spacing, noise_of(observation))

    @property
    def times(self) -> Float64[Array, " T"]:
        return self.observation.times

    def hand(self) -> tuple[Bool[Array, " T"], Float64[Array, " T"]]:
        """Whether it moves, and how much of its motion is up (1) or down (-1)."""
        if not self.hands.shape[1]:
            return np.zeros(len(self.times), bool), np.zeros(len(self.times))
        velocity = _rate(self.hands, self.times)
        speed = np.linalg.norm(velocity, axis=-1).mean(-1)
        moving = speed > max(STILL, USUAL * float(np.percentile(speed, 90)))
        vertical: Float64[Array, " T"] = velocity[..., 2].mean(-1) / np.maximum(speed, 1e-9)
        return moving, vertical

    def held(self) -> Bool[Array, " T"]:
        """Whether some controller that was at the object at first still is."""
        if not self.hands.shape[1]:
            return np.zeros(len(self.times), bool)
        apart = np.stack([cKDTree(p).query(h)[0] for p, h in zip(self.points, self.hands, strict=True)])
        spacing = max(self.spacing, 1e-3)
        holds = apart[0] < NEAR * spacing
        within: Bool[Array, " T"] = (holds & (apart <= apart[0] + REACH * spacing)).any(-1)
        return within

    def stretching(self) -> Float64[Array, " T"]:
        """How fast the distances of neighbours grow [1/s]."""
        count = min(PAIRS + 1, self.points.shape[1])
        if count < 2:
            return np.zeros(len(self.times))
        near = cKDTree(self.places).query(self.places, k=count)[1][:, 1:]
        length = np.linalg.norm(self.points[:, near] - self.points[:, :, None], axis=-1)
        rate = _rate(np.log(np.maximum(length, 1e-9)), self.times)
        both = self.known[:, near] & self.known[:, :, None]
        mean: Float64[Array, " T"] = (rate * both).sum((1, 2)) / np.maximum(both.sum((1, 2)), 1)
        return mean

    def touching(self) -> Bool[Array, " T"]:
        """Whether some point is on the ground."""
        ground = self.observation.ground_height
        if ground is None:
            return np.zeros(len(self.times), bool)
        margin = max(3.0 * self.noise, 0.25 * self.spacing)
        low: Float64[Array, " T"] = np.nanpercentile(self._told(self.points[..., 2]), 2, axis=1)
        return low < ground + margin

    def still(self) -> Bool[Array, " T"]:
        """Whether most points lie still."""
        speed = np.linalg.norm(_rate(self.points, self.times), axis=-1)
        slow: Bool[Array, " T"] = np.nanmedian(self._told(speed), axis=-1) < REST
        return slow

    def _told(self, values: Float64[Array, "T N"]) -> Float64[Array, "T N"]:
        """Values of points; NaN where these are made up, but for frames in which all are."""
        told: Float64[Array, "T N"] = np.where(self.known | ~self.known.any(1, keepdims=True), values, np.nan)
        return told


def _filled(track: Float64[Array, "T 3"], times: Float64[Array, " T"]) -> Float64[Array, "T 3"]:
    seen = np.isfinite(track[:, 0])
    return np.stack([np.interp(times, times[seen], track[seen, k]) for k in range(3)], -1)


def _known(seen: Bool[Array, "T N"], edge: int) -> Bool[Array, "T N"]:
    """From when each point is first seen until it is last seen, less an edge that means over time blur."""
    frame, last = np.arange(len(seen))[:, None], len(seen) - 1
    begin, end = seen.argmax(0), last - seen[::-1].argmax(0)
    begin, end = np.where(begin > 0, begin + edge, 0), np.where(end < last, end - edge, last)
    known: Bool[Array, "T N"] = (frame >= begin) & (frame <= end)
    return known


def _half(times: Float64[Array, " T"]) -> int:
    """Frames on either side of one that a mean over time reaches to."""
    return int(0.5 * SMOOTH / max(float(np.median(np.diff(times))), 1e-9)) if len(times) > 1 else 0


def _smooth(values: Float64[Array, "T n 3"], times: Float64[Array, " T"]) -> Float64[Array, "T n 3"]:
    """Means over a window in time, which is smaller at both ends so that it stays centred."""
    half = _half(times)
    sums = np.concatenate([np.zeros((1, *values.shape[1:])), values.cumsum(0)])
    frame = np.arange(len(values))
    reach = np.minimum(half, np.minimum(frame, frame[::-1]))
    mean: Float64[Array, "T n 3"] = (sums[frame + reach + 1] - sums[frame - reach]) / (
        2 * reach[:, None, None] + 1
    )
    return mean


def _rate(values: Float64[Array, "T n k"], times: Float64[Array, " T"]) -> Float64[Array, "T n k"]:
    if len(times) < 2:
        return np.zeros_like(values)
    rate: Float64[Array, "T n k"] = np.gradient(values, times, axis=0)
    return rate


def _merged(
    pieces: Sequence[tuple[str, int, int]], times: Float64[Array, " T"]
) -> list[tuple[str, int, int]]:
    """Give what is too short to the longer one of its neighbours, the shortest first."""

    def span(piece: tuple[str, int, int]) -> float:
        return float(times[min(piece[2], len(times) - 1)] - times[piece[1]])

    left = list(pieces)
    while len(left) > 1:
        shortest = min(range(len(left)), key=lambda i: span(left[i]))
        if span(left[shortest]) >= SHORTEST and len(left) <= MOST:
            break
        beside = [i for i in (shortest - 1, shortest + 1) if 0 <= i < len(left)]
        taker = max(beside, key=lambda i: span(left[i]))
        low, high = sorted((shortest, taker))
        left[low : high + 1] = [(left[taker][0], left[low][1], left[high][2])]
        left = _joined(left)
    return left


def _joined(pieces: Sequence[tuple[str, int, int]]) -> list[tuple[str, int, int]]:
    """Neighbours of the same name as one."""
    joined: list[tuple[str, int, int]] = []
    for name, i, j in pieces:
        if joined and joined[-1][0] == name:
            joined[-1] = (name, joined[-1][1], j)
        else:
            joined.append((name, i, j))
    return joined
