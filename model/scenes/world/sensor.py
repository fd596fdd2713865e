"""What is seen of a motion: cameras, what hides what, noise, lost tracks, and depth that one view lacks."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int

from model.scenes.world.body import spread
from model.types import Array, Camera
from model.views import look_at

Sensor: TypeAlias = Literal["depth", "camera"]
POINTS = 150
"""That are followed."""
WIDTH, HEIGHT = 640, 480
RIG = 3
"""Depth cameras around the object."""
SPACE_NOISE = 0.001
"""Standard deviation of a point measured in space [m]."""
TRACK_NOISE = 0.5
"""Standard deviation of a track in the image [px]."""
DRIFT = 0.6
"""How much of a track's error remains a frame later."""
LOST = 0.08
"""Chance that a track ends early."""
GAP = 0.004
"""Chance per frame that a track is interrupted for a few frames."""
FACING = 0.15
"""Least cosine between a surface and the way to the camera at which its texture can be followed."""
BEHIND = 1.6
"""How far behind the front-most point a point facing the camera is still seen, in spacings of the surface;
the more obliquely it is seen, the farther."""
VIEWS, ENOUGH = 12, 0.3
"""How many views are tried, and the share of the surface that a view should show at first."""
PALM, ARM = 0.033, 0.25
"""Radius of a hand and length of the arm behind it [m]."""


@dataclass(frozen=True)
class Surface:
    """What a camera can see, over time."""

    places: Float32[Array, "T M 3"]
    """[m]."""
    normals: Float32[Array, "T M 3"]
    """Outward unit vectors."""
    spacing: float
    """Between neighbouring places at rest [m]."""
    thin: bool = False
    """A cord: a tracker holds on to it whichever side it shows."""


def place_cameras(places: Float[Array, "T M 3"], count: int, rng: np.random.Generator) -> tuple[Camera, ...]:
    """Cameras around all that happens, which is in view from first to last."""
    low, high = places.min(axis=(0, 1)), places.max(axis=(0, 1))
    middle = (low + high).astype(np.float64) / 2.0
    radius = float(np.linalg.norm(places - middle, axis=2).max())
    focal = WIDTH * rng.uniform(1.0, 1.4)
    away = 1.08 * radius / np.sin(np.arctan(HEIGHT / 2.0 / focal))
    first, cameras = rng.uniform(0.0, 2.0 * np.pi), []
    for index in range(count):
        turn = first + 2.0 * np.pi * index / count + rng.uniform(-0.2, 0.2)
        rise = np.radians(rng.uniform(15.0, 50.0))
        offset = np.array([np.cos(turn) * np.cos(rise), np.sin(turn) * np.cos(rise), np.sin(rise)])
        cameras.append(look_at(middle + away * offset, middle, float(focal), WIDTH, HEIGHT))
    return tuple(cameras)


def look(
    surface: Surface, hands: Float64[Array, "T H 3"], count: int, rng: np.random.Generator
) -> tuple[Camera, ...]:
    """Cameras that see enough of the object in the first frame: of a few drawn, the best if none does."""
    first = replace(surface, places=surface.places[:1], normals=surface.normals[:1])
    best, most = tuple[Camera, ...](), -1.0
    for _ in range(VIEWS):
        cameras = place_cameras(surface.places, count, rng)
        share = float(seen(first, hands[:1], cameras).mean())
        if share > most:
            best, most = cameras, share
        if share >= ENOUGH:
            break
    return best


def seen(surface: Surface, hands: Float64[Array, "T H 3"], cameras: Sequence[Camera]) -> Bool[Array, "T M"]:
    """Which places any of the cameras sees in each frame."""
    views = [_in_front(surface, camera) & ~_behind_hand(surface, hands, camera) for camera in cameras]
    return np.asarray(np.any(views, axis=0))


def choose(
    visible: Bool[Array, "T M"], rest: Float64[Array, "M 3"], rng: np.random.Generator
) -> Int[Array, " N"]:
    """At most `POINTS` places to follow, all of them seen in the first frame, spread over the object."""
    candidates = np.flatnonzero(visible[0])
    return np.asarray(candidates[spread(rest[candidates], POINTS, rng)])


def interrupted(visible: Bool[Array, "T N"], rng: np.random.Generator) -> Bool[Array, "T N"]:
    """Fewer: some tracks are lost for good, some for a few frames; all are there in the first frame."""
    frames, count = visible.shape
    clock = np.arange(frames)[:, None]
    end = np.where(rng.random(count) < LOST, rng.integers(frames // 4, frames, count), frames)
    kept = visible & (clock < end)
    for frame, point in zip(*np.nonzero(rng.random((frames, count)) < GAP), strict=True):
        kept[frame : frame + int(rng.integers(2, 6)), point] = False
    kept[0] = visible[0]
    return np.asarray(kept)


def measured_in_space(points: Float32[Array, "T N 3"], rng: np.random.Generator) -> Float32[Array, "T N 3"]:
    """With the noise of a depth sensor."""
    return (points + rng.normal(0.0, SPACE_NOISE, points.shape)).astype(np.float32)


def lifted(
    points: Float32[Array, "T N 3"],
    guess: Float32[Array, "T N 3"],
    camera: Camera,
    rng: np.random.Generator,
) -> Float32[Array, "T N 3"]:
    """Where one camera and a guess say that points are: the tracks in the image at the depth of the guess.

    Args:
        points: Where they are [m].
        guess: Where a reference twin has them [m].
        camera: What sees them.
        rng: Of the tracks' errors, which build up over frames.
    """
    pixels, _ = camera.project(points)
    fresh = rng.normal(0.0, TRACK_NOISE * np.sqrt(1.0 - DRIFT**2), pixels.shape)
    error = np.zeros_like(pixels)
    for frame in range(1, len(pixels)):
        error[frame] = DRIFT * error[frame - 1] + fresh[frame]
    _, depth = camera.project(guess)
    return camera.unproject(pixels + error, np.maximum(depth, 0.05)).astype(np.float32)


def _in_front(surface: Surface, camera: Camera) -> Bool[Array, "T M"]:
    """Which places face the camera, with nothing before them in a buffer of depths as fine as the surface."""
    ray = camera.position - surface.places
    cosine = np.einsum("tmi,tmi->tm", surface.normals, ray) / np.linalg.norm(ray, axis=2)
    faces = (cosine > FACING) | surface.thin
    pixels, depth = camera.project(surface.places)
    focal = float(camera.intrinsics[0, 0])
    cell = max(surface.spacing * focal / float(np.median(depth)), 1.0)
    columns, rows = int(WIDTH / cell) + 3, int(HEIGHT / cell) + 3
    place = np.floor(pixels / cell).astype(np.int64) + 1
    within = ((place >= 1) & (place < (columns - 1, rows - 1))).all(axis=2) & (depth > 0.0)
    place = np.where(within[..., None], place, 1)
    frame = np.broadcast_to(np.arange(len(depth))[:, None], depth.shape)
    nearest = np.full((len(depth), rows, columns), np.inf)
    np.minimum.at(nearest, (frame, place[..., 1], place[..., 0]), np.where(within, depth, np.inf))
    # a disc covers the cells beside its own; those across a corner it does not reach
    across = np.minimum(nearest[:, 1:-1, :-2], nearest[:, 1:-1, 2:])
    upright = np.minimum(nearest[:, :-2, 1:-1], nearest[:, 2:, 1:-1])
    nearest[:, 1:-1, 1:-1] = np.minimum(nearest[:, 1:-1, 1:-1], np.minimum(across, upright))
    front = nearest[frame, place[..., 1], place[..., 0]]
    slack = BEHIND * surface.spacing / np.maximum(cosine, FACING)
    return np.asarray(within & faces & (depth <= front + slack))


def _behind_hand(surface: Surface, hands: Float64[Array, "T H 3"], camera: Camera) -> Bool[Array, "T M"]:
    """Whether a hand, or the arm that comes from above and beyond it, is in the way."""
    hidden = np.zeros(surface.places.shape[:2], bool)
    eye = camera.position
    ray = surface.places - eye
    length = np.linalg.norm(ray, axis=2)
    ray = ray / length[..., None]
    behind = camera.forward * (1.0, 1.0, 0.0)
    arm = np.array([0.0, 0.0, 0.7]) + 0.7 * behind / max(float(np.linalg.norm(behind)), 1e-9)
    for hand in range(hands.shape[1]):
        for share in np.linspace(0.0, 1.0, 6):
            ball = hands[:, hand] + (0.02 + share * ARM) * arm - eye
            along = np.einsum("tmi,ti->tm", ray, ball)
            off = np.linalg.norm(ball, axis=1)[:, None] ** 2 - along**2
            hidden |= (off < PALM**2) & (along < length)
    return hidden
