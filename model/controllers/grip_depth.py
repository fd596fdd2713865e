r"""How far from the camera a grip is, frame by frame: what one view leaves open, decided physically.

The keyframe's depth is the reconstruction's. Afterwards, in this order:

1. *Constant depth*: the grip moves parallel to the image. (Of a camera that looks down on a table this is up
   and slightly away, which is how a hand lifts. Measured on a rope lifted at one end: it keeps the rope's
   length, where a vertical plane through the grip would stretch the rope by a third.)
2. *Not into the ground*: a grip that would sink below its rest height slides at that height instead: the
   depth is the nearer of constant depth and of the ray's meeting with the plane of the rest height.
3. *No stretching*: a grip may not be farther from a place of the object that visibly stays where it was, nor
   from another grip, than the way through the object allows (plus `SLACK`). Against a resting place the
   grip moves along its ray as little as makes that hold, two grips come nearer to the camera together.

Depths are smoothed in time at last, without lag.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64

from model.controllers.grip_motion import smoothed
from model.types import Array, Calibration, Camera

SLACK = 1.04
"""How much longer than the way through the object at rest a distance may become."""

OUTLIERS = 0.1
"""Share of the resting places that may be wrong: tracks that stick to the background."""
NEAREST_TETHER = 0.25
"""Places nearer to the grip than this share of the farthest say nothing about its depth."""
FEWEST_TETHERS = 4


@dataclass(frozen=True)
class Tethers:
    """Places of the object that stay where they are for a while, and how far a grip may be from them."""

    places: Float64[Array, "M 3"]
    """[m]."""
    reach: Float64[Array, " M"]
    """The way through the object at rest [m]."""
    resting: Bool[Array, "T M"]
    """Whether the place is still where it was."""


def constant_depth(
    pixels: Float64[Array, "T 2"], start: Float64[Array, " 3"], calibration: Calibration
) -> Float64[Array, " T"]:
    """Rules 1 and 2: depth [m] of a grip that starts at `start` and is then seen at `pixels`."""
    camera = calibration.camera
    depth = np.full(len(pixels), float(camera.project(start)[1]))
    if calibration.ground_height is None:
        return depth
    floor = max(float(start[2]), calibration.ground_height)
    return np.asarray(np.minimum(depth, _depth_on_plane(camera, pixels, floor)), np.float64)


def tethered_depth(
    pixels: Float64[Array, "T 2"], depth: Float64[Array, " T"], tethers: Tethers, camera: Camera
) -> Float64[Array, " T"]:
    """Rule 3 against resting places: the depth nearest to `depth` within reach of all of them."""
    result = depth.copy()
    rays = camera.unproject(pixels, np.ones(len(pixels))) - camera.position
    far = tethers.reach > NEAREST_TETHER * tethers.reach.max(initial=0.0)
    for index, quiet in enumerate(tethers.resting):
        holding = quiet & far
        if holding.sum() >= max(FEWEST_TETHERS, 0.1 * len(quiet)):
            result[index] = np.clip(depth[index], *_reachable(camera.position, rays[index], tethers, holding))
    return result


def paired_scale(
    first: Float64[Array, "T 3"], second: Float64[Array, "T 3"], reach: float
) -> Float64[Array, " T"]:
    """Rule 3 between two grips: what both depths are multiplied by, at most 1."""
    apart = np.linalg.norm(first - second, axis=1)
    return np.asarray(np.minimum(1.0, SLACK * reach / np.maximum(apart, 1e-9)), np.float64)


def smooth_depth(depth: Float64[Array, " T"]) -> Float64[Array, " T"]:
    """Depths without jitter; the first stays."""
    return np.asarray(smoothed(depth[:, None])[:, 0], np.float64)


def _depth_on_plane(camera: Camera, pixels: Float[Array, "T 2"], height: float) -> Float64[Array, " T"]:
    """Depth [m] at which each ray meets z = height; infinite where it does not in front of the camera."""
    rays = camera.unproject(pixels, np.ones(len(pixels))) - camera.position
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (height - camera.position[2]) / rays[:, 2]
    return np.asarray(np.where(np.isfinite(depth) & (depth > 0), depth, np.inf), np.float64)


def _reachable(
    origin: Float64[Array, " 3"], ray: Float64[Array, " 3"], tethers: Tethers, resting: Bool[Array, " M"]
) -> tuple[float, float]:
    """The interval of depths on a ray that is within reach of the resting places, but for a few outliers.

    Where a ray passes all too far, the nearest approach is what remains.
    """
    offset = tethers.places[resting] - origin
    nearest = offset @ ray / (ray @ ray)
    away = np.linalg.norm(offset - nearest[:, None] * ray, axis=1)
    half = np.sqrt(np.maximum((SLACK * tethers.reach[resting]) ** 2 - away**2, 0.0)) / np.linalg.norm(ray)
    low, high = np.quantile(nearest - half, 1.0 - OUTLIERS), np.quantile(nearest + half, OUTLIERS)
    if low > high:
        low = high = 0.5 * (low + high)
    return float(low), float(high)
