"""What a camera would see of an object whose observed points move in a given way."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32
from scipy.spatial import cKDTree

from model.preview import TwinFrame, render_rollout
from model.rendering import best_renderer
from model.scenes.case import Case
from model.skinning import bind
from model.types import Array, Camera, Gaussians, Topology
from model.views import overview, scaled

LONGEST_SIDE = 240
"""Of the pictures that are compared [px]."""
NEIGHBOURS = 8
"""Observed points that each observed point is joined to."""


@dataclass(frozen=True)
class Looks:
    """An object's looks, carried by its observed points.

    Every method says where the observed points are and nothing more, so the true and the predicted picture
    come about in the same way: Gaussians follow the observed points near to them, and one camera sees them,
    without hand and table, on black.
    """

    gaussians: Gaussians
    carrier: Topology
    """The observed points, with springs between neighbours."""
    camera: Camera

    def pictures(self, points: Float32[Array, "T N 3"]) -> Iterator[TwinFrame]:
        """The object with its observed points at each of `points` [m]."""
        return render_rollout(self.gaussians, self.carrier, points, self.camera, best_renderer())


def looks_of(case: Case, motion: Float32[Array, "T N 3"]) -> Looks | None:
    """The looks of a case, seen by its camera or else by one that sees all of its motion.

    Args:
        case: Its Gaussians are where the rest state is.
        motion: Where the observed points really are over time [m]; NaN where it is not known.

    Returns:
        None for a case without looks.
    """
    if case.gaussians is None or not len(case.gaussians):
        return None
    carrier = _carrier(case.rest, case.gaussians)
    if case.camera is not None:
        camera = scaled(case.camera, LONGEST_SIDE)
    else:
        known = motion[np.isfinite(motion).all(axis=2)]
        seen = np.concatenate([known, case.rest, case.gaussians.means])
        camera = overview(seen, LONGEST_SIDE, 3 * LONGEST_SIDE // 4)
    return Looks(case.gaussians, carrier, camera)


def _carrier(rest: Float32[Array, "N 3"], gaussians: Gaussians) -> Topology:
    count = min(NEIGHBOURS + 1, len(rest))
    near = cKDTree(rest).query(rest, count)[1].reshape(len(rest), count)[:, 1:]
    pairs = np.stack([np.repeat(np.arange(len(rest)), count - 1), near.ravel()], axis=1)
    springs = np.unique(np.sort(pairs, axis=1), axis=0).astype(np.int32)
    index, weight = bind(gaussians.means, rest, springs=springs)
    return Topology(
        points=rest,
        mass=np.ones(len(rest), np.float32),
        springs=springs,
        rest_length=np.linalg.norm(rest[springs[:, 0]] - rest[springs[:, 1]], axis=1).astype(np.float32),
        part=np.zeros(len(rest), np.int32),
        binding_index=index,
        binding_weight=weight,
        controller_points=np.zeros((0, 3), np.float32),
        controller_springs=np.zeros((0, 2), np.int32),
        controller_rest_length=np.zeros(0, np.float32),
    )
