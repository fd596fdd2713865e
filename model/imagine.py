"""A twin as a case: how it would be seen to move if its parts were made of what one says."""

from collections.abc import Sequence

import numpy as np

from model.bundle import TwinBundle
from model.formats.parameters import gravity, ground_height
from model.scenes.case import Anchors, Case
from model.types import MaterialPrior, Observation, ShapeClass

NAME = "imagined"


def imagine(twin: TwinBundle, priors: Sequence[MaterialPrior], shape_class: ShapeClass) -> Case:
    """The twin's own rollout under its recorded motion, as if its points had been tracked in space.

    A bundle does not keep how the object was seen to move. Where its mechanics are those of that object, its
    rollout says so; where a user has changed them, its rollout is what would have been seen.

    Args:
        twin: Effects that it carries act.
        priors: One per part: what it is made of.
        shape_class: Sheet, rope or solid.

    Raises:
        InputError: it does not roll out.
    """
    topology, trajectory = twin.topology, twin.rollout()
    count, frames = len(topology.points), len(trajectory.times)
    hands = topology.controller_points[None].repeat(frames, axis=0)
    observation = Observation(
        times=trajectory.times,
        points=trajectory.points,
        controllers=hands if twin.controls is None else twin.controls,
        ground_height=ground_height(twin.parameters),
        gravity=gravity(twin.parameters),
    )
    return Case(
        name=NAME,
        object_name=NAME,
        object_class="unknown",
        interaction="unknown",
        shape_class=shape_class,
        topology=topology,
        priors=tuple(priors),
        observation=observation,
        rest=topology.points,
        anchors=Anchors(np.arange(count, dtype=np.int32)[:, None], np.ones((count, 1), np.float32)),
        split=frames,
    )
