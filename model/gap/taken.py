"""What of a recording is diagnosed: the frames in which the object is seen and nothing unseen holds it."""

import warnings
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from model.gap.bodies.frames import frames_of
from model.gap.bodies.let_go import let_go
from model.gap.bodies.neighbours import covering_points
from model.gap.diagnosable import (
    POINTS,
    check_diagnosable,
    check_enough,
    check_moves,
    check_transfer,
    stays_within,
)
from model.gap.same_points import same_points
from model.gap.schema import GapReport, PartShare
from model.types import Array, Observation

MOST = 400
"""Points that are looked at: a body has fewer, and what is of all pairs of points takes their square."""
OFTEN = 0.5
"""Of the frames in which the usual point is seen: points that are seen less often are not looked at, then."""


@dataclass(frozen=True)
class Taken:
    """A recording, and what of it is diagnosed."""

    whole: Observation
    """As it came."""
    observation: Observation
    """What is diagnosed."""
    first: int
    """The frame of `whole` that it begins with."""

    kept: Int64[Array, " n"]
    """The points of `whole` that are looked at."""
    stands_in: Int64[Array, " N"]
    """Which of these each point of `whole` is told by, the nearest; -1: none, it is never seen."""

    @classmethod
    def of(cls, whole: Observation, name: str) -> "Taken":
        """Take what can be diagnosed, and warn of what was left out.

        A diagnosis begins with where object and hand are in the first frame, so that must be one in which the
        object is seen. At its end a twin is judged by what is seen.

        Args:
            whole: Within its contract.
            name: What messages call it.

        Raises:
            InputError: as `check_diagnosable` and `check_moves` do.
        """
        check_enough(whole, name)
        kept, stands_in = _covering(whole)
        count = whole.points.shape[1]
        if len(kept) < count:
            warnings.warn(
                f"{name}: {count} points are more than a diagnosis can look at: {len(kept)} that cover the "
                "object stand for all",
                stacklevel=2,
            )
        taken, first = _shown(points_of(whole, kept), name)
        check_moves(taken, name)
        return cls(whole, taken, first, kept, stands_in)

    def other(self, whole: Observation, name: str) -> Observation:
        """What is taken of another recording of the object, to confirm what this one says.

        The same points, if those were tracked. One in which nothing moves confirms little: it is taken with a
        warning, since the first can be diagnosed all the same.

        Args:
            whole: Within its contract.
            name: What messages call it.

        Raises:
            InputError: as `check_diagnosable` and `check_transfer` do.
        """
        check_enough(whole, name)
        kept = self.kept if same_points(self.whole, whole) else _covering(whole)[0]
        taken = _shown(points_of(whole, kept), name)[0]
        check_transfer(self.observation, taken, name)
        limit = stays_within(taken)
        if limit is not None:
            warnings.warn(
                f"{name}: nothing moves by more than {1e3 * limit:.2g} mm, as noise does: it confirms little",
                stacklevel=2,
            )
        return taken

    def report(self, found: GapReport) -> GapReport:
        """What was found, said of all frames and points of the recording.

        Nothing of the gap lies in frames that were left out. A point's share is divided among those that it
        stands for, and goes to the parts that these belong to.

        Args:
            found: Of `observation`.
        """
        frames = np.zeros(len(self.whole.times))
        frames[self.first : self.first + len(self.observation.times)] = found.where.frames
        told, by = self.stands_in >= 0, self.stands_in
        count = np.bincount(by[told], minlength=len(self.kept))
        shares, acts = np.array(found.where.points), np.array(found.where.acts_on)
        points = np.where(told, shares[by] / np.maximum(count[by], 1), 0.0)
        where = found.where.model_copy(
            update={
                "frames": tuple(frames.tolist()),
                "points": tuple(points.tolist()),
                "parts": found.where.parts if len(by) == len(self.kept) else self._parts(found, points),
                "acts_on": tuple(np.where(told, acts[by], 0.0).tolist()),
            }
        )
        return found.model_copy(update={"where": where})

    def _parts(self, found: GapReport, points: Float64[Array, " N"]) -> tuple[PartShare, ...]:
        """What the labelled parts have of the gap, also those of which no point was looked at."""
        if self.whole.parts is None:
            return found.where.parts
        labels, part = np.unique(self.whole.parts, return_inverse=True)
        shares = np.bincount(part, points)
        return tuple(
            PartShare(part=int(label), share=min(float(share), 1.0))
            for label, share in zip(labels, shares, strict=True)
        )


def points_of(observation: Observation, points: Int64[Array, " n"]) -> Observation:
    """Some points of a recording."""
    colors, parts = observation.colors, observation.parts
    return replace(
        observation,
        points=observation.points[:, points],
        colors=None if colors is None else colors[points],
        parts=None if parts is None else parts[points],
    )


def _covering(observation: Observation) -> tuple[Int64[Array, " n"], Int64[Array, " N"]]:
    """Points to look at, and which of them each point is told by."""
    count = observation.points.shape[1]
    if count <= MOST:
        return np.arange(count), np.arange(count)
    seen = np.isfinite(observation.points[..., 0])
    times = seen.sum(0)
    ever = np.flatnonzero(times)
    places = observation.points[seen.argmax(0), np.arange(count)].astype(np.float64)
    often = np.flatnonzero((times > 0) & (times >= OFTEN * np.median(times[ever])))
    kept = often[covering_points(places[often], MOST)]
    stands_in, first = np.full(count, -1), seen.argmax(0)
    for frame in np.unique(first[ever]):
        new, there = ever[first[ever] == frame], np.flatnonzero(seen[frame, kept])
        there = there if len(there) else np.arange(len(kept))
        tree = cKDTree(observation.points[frame, kept[there]] if seen[frame, kept].any() else places[kept])
        stands_in[new] = there[tree.query(places[new])[1]]
    # several may be in one place, of which another is as near
    stands_in[kept] = np.arange(len(kept))
    return kept, stands_in


def _shown(whole: Observation, name: str) -> tuple[Observation, int]:
    """The recording while the object is seen and nothing unseen holds it, and its first frame."""
    seen = np.isfinite(whole.points[..., 0]).sum(1) >= POINTS
    begin, end = int(seen.argmax()), len(seen) - int(seen[::-1].argmax())
    taken = frames_of(whole, slice(begin, end))
    held = let_go(taken)
    taken = frames_of(taken, slice(held, None))
    check_diagnosable(taken, name)
    for count, where in ((begin, "first"), (len(seen) - end, "last")):
        if count:
            warnings.warn(
                f"{name}: fewer than {POINTS} points are seen in the {where} {_frames(count)}: left out",
                stacklevel=3,
            )
    if held:
        warnings.warn(
            f"{name}: something that is no controller holds the object still up to frame {begin + held} "
            "and lets it go: the frames before were left out",
            stacklevel=3,
        )
    return taken, begin + held


def _frames(count: int) -> str:
    return "frame" if count == 1 else f"{count} frames"
