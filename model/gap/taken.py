"""What of a recording is diagnosed: the frames in which the object is seen, and nothing unseen holds it."""

import warnings
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool

from model.gap.bodies.let_go import let_go
from model.gap.diagnosable import POINTS, check_diagnosable, check_enough
from model.gap.schema import GapReport
from model.types import Array, Observation


@dataclass(frozen=True)
class Taken:
    """A recording, and what of it is diagnosed."""

    whole: Observation
    """As it came."""
    observation: Observation
    """What is diagnosed."""
    first: int
    """The frame of `whole` that it begins with."""

    def report(self, found: GapReport) -> GapReport:
        """What was found, said of all frames of the recording: nothing lies in those that were left out.

        Args:
            found: Of `observation`.
        """
        frames = np.zeros(len(self.whole.times))
        frames[self.first : self.first + len(self.observation.times)] = found.where.frames
        where = found.where.model_copy(update={"frames": tuple(frames.tolist())})
        return found.model_copy(update={"where": where})

    @classmethod
    def of(cls, whole: Observation, name: str) -> "Taken":
        """Take what can be diagnosed, and warn of what was left out.

        A diagnosis begins with where object and hand are in the first frame, so that must be one in which the
        object is seen. At its end a twin is judged by what is seen.

        Args:
            whole: Within its contract.
            name: What messages call it.

        Raises:
            InputError: as `check_diagnosable` does.
        """
        check_enough(whole, name)
        seen = _shown(whole)
        begin, end = int(seen.argmax()), len(seen) - int(seen[::-1].argmax())
        taken = frames_of(whole, slice(begin, end))
        held = let_go(taken)
        taken = frames_of(taken, slice(held, None))
        check_diagnosable(taken, name)
        for count, where in ((begin, "first"), (len(seen) - end, "last")):
            if count:
                warnings.warn(
                    f"{name}: fewer than {POINTS} points are seen in the {where} {_frames(count)}: left out",
                    stacklevel=2,
                )
        if held:
            warnings.warn(
                f"{name}: something that is no controller holds the object still up to frame {begin + held} "
                "and lets it go: the frames before were left out",
                stacklevel=2,
            )
        return cls(whole, taken, begin + held)


def frames_of(observation: Observation, frames: slice) -> Observation:
    """Some frames of a recording."""
    return replace(
        observation,
        times=observation.times[frames],
        points=observation.points[frames],
        controllers=observation.controllers[frames],
    )


def _shown(observation: Observation) -> Bool[Array, " T"]:
    """Whether enough of the object is seen in a frame to say where it is."""
    shown: Bool[Array, " T"] = np.isfinite(observation.points[..., 0]).sum(1) >= POINTS
    return shown


def _frames(count: int) -> str:
    return "frame" if count == 1 else f"{count} frames"
