"""An observation, moved to where its object's twin is."""

import math
import warnings
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from model.errors import InputError
from model.gap.bodies.first import first_places
from model.gap.bodies.turns import nearest_rotation
from model.gap.size import size_of
from model.types import Array, Observation

SIZES = (0.2, 3.0)
"""What is seen of an object, over the size of its twin: a part at least, and not much more than all."""
NEAR, FAR = 0.75, 2.5
"""Spacings: half of the seen points are as near to a point of the twin, and 9 of 10 within the second."""
STEPS = 25
FEW = 200
"""Points that are looked at while it is moved."""
TURNS = np.arange(0.0, 2.0 * np.pi, np.pi / 6.0)
"""About the vertical [rad], from which a place is looked for."""
UPRIGHT = math.radians(3.0)
"""A turn that tilts the vertical by less is one about the vertical: the rest is noise."""


@dataclass(frozen=True)
class Motion:
    """A rigid motion, x → R x + t."""

    rotation: Float64[Array, "3 3"]
    shift: Float64[Array, "3"]

    def __call__(self, points: Float64[Array, "*n 3"]) -> Float64[Array, "*n 3"]:
        """Points after it [m]."""
        moved: Float64[Array, "*n 3"] = points @ self.rotation.T + self.shift
        return moved

    @property
    def tilt(self) -> float:
        """Angle of the vertical to where it was [rad]."""
        return float(np.arccos(np.clip(self.rotation[2, 2], -1.0, 1.0)))


def onto_twin(observation: Observation, points: Float64[Array, "P 3"], spacing: float) -> Observation:
    """The observation where its first frame lies on the twin at rest.

    One that lies there is returned as it is. Otherwise it is moved there as a whole, with its controllers,
    gravity and ground, and a warning says so.

    Args:
        observation: What moved.
        points: Of the twin at rest [m].
        spacing: Of these points [m].

    Raises:
        InputError: the twin is of another size, or its shape is not that of the first frame.
    """
    seen = first_places(observation)
    seen = seen[np.isfinite(seen[:, 0])]
    if not len(seen):
        raise InputError("points: none is ever seen: nothing to lay on the twin")
    size, other = (max(size_of(places), 1e-9) for places in (seen, points))
    if len(seen) > 2 and not SIZES[0] <= size / other <= SIZES[1]:
        hint = (
            ": another unit?" if max(size / other, other / size) > 100 else ": is it the twin of this object?"
        )
        raise InputError(f"points: the object seen measures {size:.3g} m, the twin {other:.3g} m{hint}")
    tree = cKDTree(points)
    if _lies_on(tree.query(seen)[0], spacing):
        return observation
    motion = _found(seen, points, tree, spacing)
    if motion is None:
        away = float(np.median(tree.query(seen)[0]))
        raise InputError(
            f"points: the first frame fits the twin nowhere (as it is, its points are {away:.3g} m from the "
            "twin's): it has to show the object of the twin, in the shape that the twin has at rest"
        )
    laid = moved(observation, motion)
    turn = math.degrees(float(Rotation.from_matrix(motion.rotation).magnitude()))
    shift = float(np.linalg.norm(motion(seen).mean(0) - seen.mean(0)))
    warnings.warn(
        f"the observation was moved onto the twin, by {shift:.2g} m and {turn:.0f}°: places and directions "
        "in the report are the twin's",
        stacklevel=2,
    )
    return laid


def moved_alike(other: Observation, before: Observation, after: Observation) -> Observation:
    """Another recording of an object, moved as one of them was: what has a direction is the same in both.

    Args:
        other: The other recording, in the axes of `before`.
        before: A recording as it came.
        after: The same, as `onto_twin` returns it.
    """
    here, there = (one.points.reshape(-1, 3).astype(np.float64) for one in (before, after))
    seen = np.isfinite(here[:, 0]) & np.isfinite(there[:, 0])
    if before is after or np.array_equal(here[seen], there[seen]):
        return other
    return moved(other, rigid_motion(here[seen], there[seen]))


def _found(
    seen: Float64[Array, "N 3"], points: Float64[Array, "P 3"], tree: cKDTree, spacing: float
) -> Motion | None:
    """The motion that lays what is seen on the twin: upright if that fits, else any; None: nothing fits."""
    some = seen[np.linspace(0, len(seen) - 1, min(FEW, len(seen))).astype(int)]
    for sides in (Rotation.identity(1), Rotation.create_group("O")):
        candidates = [
            _settled(some, points, tree, (Rotation.from_rotvec([0.0, 0.0, turn]) * side).as_matrix())
            for side in sides
            for turn in TURNS
        ]
        best = min(candidates, key=lambda motion: float((tree.query(motion(some))[0] ** 2).mean()))
        best = _levelled(best, some) if best.tilt <= UPRIGHT else best
        if _lies_on(tree.query(best(seen))[0], spacing):
            return best
    return None


def _levelled(motion: Motion, seen: Float64[Array, "N 3"]) -> Motion:
    """The nearest motion that leaves the vertical where it is."""
    (xx, xy), (yx, yy) = motion.rotation[:2, :2]
    turn = math.atan2(yx - xy, xx + yy)
    rotation = Rotation.from_rotvec([0.0, 0.0, turn]).as_matrix()
    return Motion(rotation, motion(seen).mean(0) - rotation @ seen.mean(0))


def _settled(
    seen: Float64[Array, "N 3"],
    points: Float64[Array, "P 3"],
    tree: cKDTree,
    rotation: Float64[Array, "3 3"],
) -> Motion:
    """From a rotation, middle on middle, each point drawn to the nearest of the twin.

    Reference:
        Besl and McKay (1992), A method for registration of 3-D shapes, IEEE Transactions on Pattern Analysis
        and Machine Intelligence 14.
    """
    motion = Motion(rotation, points.mean(0) - rotation @ seen.mean(0))
    for _ in range(STEPS):
        motion = rigid_motion(seen, points[tree.query(motion(seen))[1]])
    return motion


def rigid_motion(here: Float64[Array, "N 3"], there: Float64[Array, "N 3"]) -> Motion:
    """The rigid motion that brings points nearest to others, in the mean square."""
    middle, target = here.mean(0), there.mean(0)
    rotation = nearest_rotation((there - target).T @ (here - middle))
    return Motion(rotation, target - rotation @ middle)


def moved(observation: Observation, motion: Motion) -> Observation:
    """As a whole, with its controllers, gravity and ground.

    Raises:
        InputError: there is a ground, and it would not be level any more.
    """
    ground = observation.ground_height
    if ground is not None:
        if motion.tilt > UPRIGHT:
            raise InputError(
                f"points: the object lies {math.degrees(motion.tilt):.0f}° from how its twin does: the "
                "ground of a twin is level"
            )
        ground += float(motion.shift[2])
    x, y, z = (float(value) for value in motion.rotation @ np.asarray(observation.gravity))
    return replace(
        observation,
        points=motion(observation.points.astype(np.float64)).astype(np.float32),
        controllers=motion(observation.controllers.astype(np.float64)).astype(np.float32),
        ground_height=ground,
        gravity=(x, y, z),
    )


def _lies_on(distance: Float64[Array, " N"], spacing: float) -> bool:
    half, most = np.quantile(distance, (0.5, 0.9))
    return bool(half <= NEAR * spacing and most <= FAR * spacing)
