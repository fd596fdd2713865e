"""Some frames of a recording."""

from dataclasses import replace

from model.types import Observation


def frames_of(observation: Observation, frames: slice) -> Observation:
    """With its times as they are: the first is no zero."""
    return replace(
        observation,
        times=observation.times[frames],
        points=observation.points[frames],
        controllers=observation.controllers[frames],
    )
