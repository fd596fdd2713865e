"""Where the hand holds the object, over time, in metres: what drives the replay of a clip."""

from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float64, Int
from scipy.spatial import cKDTree

from model.controllers.contact import HANDS, centre_of, contact_groups, grown, later_grip, touch_distance
from model.controllers.geodesics import ways_through
from model.controllers.grip_depth import Tethers, constant_depth, paired_scale, smooth_depth, tethered_depth
from model.controllers.grip_motion import GripPath, Track, follow_back, follow_grip, joined
from model.errors import InputError
from model.formats.npz import read_arrays
from model.types import Array, Calibration, Controllers, Frames, Gaussians, Masks, Tracks

PER_GRIP = 6
"""Controller points per grip."""
GRASP_DEPTH = 0.08
"""Fingers hold what lies behind the front of the contact by at most this share of the object's size."""
STILL = 2.0
"""A place of the object that moved less than this since the keyframe rests [px]."""
MEETING = 0.02
"""Motion and clip must share more than this of the longer one's time: with less the clock is another."""
STANDING = 0.1
"""Share of the clip without a word of the hand's motion that is worth one of ours."""
RELEASE = 6
"""Frames without contact that count as letting go."""


def find_controllers(
    frames: Frames,
    masks: Masks,
    tracks: Tracks,
    calibration: Calibration,
    gaussians: Gaussians,
    tracker: Track,
) -> Controllers:
    """Find the grips of the keyframe and follow them to the end of the clip.

    A grip is where a hand touches the object on the keyframe. Up to six points of the object that the
    fingers enclose move rigidly with it: in the image as tracks on the fingers and beside them say, in depth
    by the rules of `model.controllers.grip_depth`, turning about the optical axis.

    A hand that comes later holds the place it will touch from the start: a twin's controllers hold
    throughout. Until the hand arrives that place moves as the object itself is seen to move there (not at
    all while it rests), so holding it changes nothing.

    Args:
        frames: The clip.
        masks: Object and hand.
        tracks: Of the object, from the keyframe.
        calibration: Camera and ground.
        gaussians: The object on the keyframe.
        tracker: Follows pixels through (part of) a clip.
    """
    key = masks.keyframe
    found = [(key, patch) for patch in contact_groups(masks.object[key], masks.hand[key])]
    paths = [_path(frames, masks, start, patch, tracker) for start, patch in found]
    while len(found) < HANDS:
        later = later_grip(masks, key, [path.position for path in paths])
        if later is None:
            break
        found.append(later)
        paths.append(_path(frames, masks, *later, tracker))
    if not found:
        warning = "nothing holds the object; it will fall or rest"
        empty = np.zeros((len(frames.images) - key, 0, 3), np.float32)
        return Controllers(empty, np.zeros(0, int), (warning,))
    rest = [
        _held_points(_moved(patch, path.position[0] - path.position[start - key]), calibration, gaussians)
        for (start, patch), path in zip(found, paths, strict=True)
    ]
    motion = np.concatenate(_lift(paths, rest, tracks, calibration, gaussians, key), axis=1)
    group = np.repeat(np.arange(len(rest)), [len(points) for points in rest])
    return Controllers(motion.astype(np.float32), group, tuple(_doubts(found, paths, frames, key)))


def read_controllers(path: Path, frames: Frames, masks: Masks) -> Controllers:
    """Read the controllers' motion that the user brings, resampled at the frames from the keyframe on.

    Args:
        path: A `.npz` with `controllers` or `controls` [T, C, 3] in metres in the twin's world, and
            optionally `times` [T] in seconds on the clip's clock (its first frame is 0). Without times there
            is one row per frame of the clip (with those that thinning left out), or one per frame from the
            keyframe on.
        frames: The clip.
        masks: Their keyframe is where the motion starts.

    Raises:
        InputError: an array is missing, has another shape, is not finite, or its times are not the clip's.
    """
    arrays = read_arrays(path, ("controllers", "controls", "times"))
    name = next((name for name in ("controllers", "controls") if name in arrays), None)
    if name is None:
        raise InputError(f"{path.name}: controllers is missing: expected an array [T, C, 3] in metres")
    motion = arrays[name].astype(np.float64)
    if motion.ndim != 3 or motion.shape[2] != 3 or len(motion) == 0:
        raise InputError(f"{path.name}: {name}: expected shape [T, C, 3], found {list(motion.shape)}")
    if not np.isfinite(motion).all():
        frame = int(np.argwhere(~np.isfinite(motion))[0][0])
        raise InputError(f"{path.name}: {name}[{frame}]: expected finite numbers, found NaN or infinity")
    if motion.shape[1] == 0:
        empty = np.zeros((len(frames.times) - masks.keyframe, 0, 3), np.float32)
        nobody = f"{path.name} holds no controller: the object will fall or rest"
        return Controllers(empty, np.zeros(0, int), (nobody,))
    still = np.zeros(motion.shape[1], int)
    if "times" not in arrays:
        rows = _rows_of(path, name, len(motion), frames, masks.keyframe)
        return Controllers(motion[rows].astype(np.float32), still)
    wanted = frames.times[masks.keyframe :]
    times = _checked_times(path, arrays["times"], len(motion))
    doubts = _clock_doubts(path, times, wanted)
    flat = motion.reshape(len(motion), -1)
    resampled = np.stack([np.interp(wanted, times, column) for column in flat.T], axis=1)
    placed = resampled.reshape(len(wanted), motion.shape[1], 3).astype(np.float32)
    return Controllers(placed, still, doubts)


def _rows_of(path: Path, name: str, rows: int, frames: Frames, keyframe: int) -> Int[Array, " T"]:
    """Which rows belong to the frames from the keyframe on."""
    wanted = np.array([frames.number(index) for index in range(keyframe, len(frames.images))])
    key = int(wanted[0])
    for first in (key, 0):
        if rows == frames.length - first:
            return wanted - first
    raise InputError(
        f"{path.name}: {name}: expected {frames.length - key} rows (frames from keyframe {key} on) or "
        f"{frames.length} (all frames), found {rows}; or give times [T] in seconds"
    )


def _checked_times(path: Path, times: Array, rows: int) -> Float64[Array, " T"]:
    if times.shape != (rows,):
        raise InputError(f"{path.name}: times: expected shape [{rows}], found {list(times.shape)}")
    seconds = times.astype(np.float64)
    if not np.isfinite(seconds).all() or not (np.diff(seconds) > 0).all():
        raise InputError(f"{path.name}: times: expected finite, strictly increasing seconds")
    return seconds


def _clock_doubts(path: Path, times: Float64[Array, " R"], wanted: Float64[Array, " T"]) -> tuple[str, ...]:
    """What is doubtful about the clock of a motion: outside of its own times the hand stands still.

    Raises:
        InputError: it is another clock, or not in seconds: next to nothing of the clip and of the motion
            meet, and the hand would be frozen throughout.
    """
    first, last = float(wanted[0]), float(wanted[-1])
    if len(times) == 1 or last == first:
        return ()
    shared = min(last, float(times[-1])) - max(first, float(times[0]))
    if shared < MEETING * max(last - first, float(times[-1] - times[0])):
        raise InputError(
            f"{path.name}: times run from {times[0]:g} to {times[-1]:g}, the clip from its keyframe on from "
            f"{first:g} to {last:g} s: expected seconds on the clip's clock, whose first frame is 0"
        )
    uncovered = 1.0 - shared / (last - first)
    if uncovered <= STANDING:
        return ()
    return (f"{path.name} says nothing of {uncovered:.0%} of the clip's time: the hand stands still there",)


def _path(frames: Frames, masks: Masks, start: int, patch: Bool[Array, "H W"], tracker: Track) -> GripPath:
    """The grip that is at `patch` on frame `start`, from the keyframe to the end."""
    place = centre_of(patch)
    radius = float(np.clip(0.3 * np.sqrt(masks.object[start].sum()), 15.0, 70.0))
    after = follow_grip(frames, masks, start, place, radius, tracker)
    if start == masks.keyframe:
        return after
    return joined(follow_back(frames, masks, start, place, radius, tracker), after)


def _doubts(
    found: list[tuple[int, Bool[Array, "H W"]]], paths: list[GripPath], frames: Frames, key: int
) -> list[str]:
    """What the reader should know about the grips."""
    notes = []
    for index, ((start, _), path) in enumerate(zip(found, paths, strict=True)):
        if start > key:
            notes.append(
                f"hand {index} touches the object first on frame {frames.number(start)}; "
                "until then the place it will touch follows the object"
            )
        lost = 1.0 - path.tracked.mean()
        if lost > 0.2:
            notes.append(f"hand {index} followed by the masks alone in {lost:.0%} of the frames")
        if len(path.touching) < RELEASE:
            continue
        apart = np.convolve(~path.touching, np.ones(RELEASE), "valid") >= RELEASE
        if apart.any():
            frame = frames.number(key + int(np.argmax(apart)))
            notes.append(f"hand {index} seems to let go on frame {frame}; the replay holds on")
    return notes


def _moved(patch: Bool[Array, "H W"], shift: Float64[Array, " 2"]) -> Bool[Array, "H W"]:
    """The patch moved by (x, y) [px]; what leaves the image stays at its border."""
    rows, columns = np.nonzero(patch)
    height, width = patch.shape
    result = np.zeros_like(patch)
    rows = np.clip(rows + round(float(shift[1])), 0, height - 1)
    result[rows, np.clip(columns + round(float(shift[0])), 0, width - 1)] = True
    return result


def _held_points(
    patch: Bool[Array, "H W"], calibration: Calibration, gaussians: Gaussians
) -> Float64[Array, "c 3"]:
    """Up to `PER_GRIP` Gaussians that the fingers enclose, spread over the contact patch."""
    means = gaussians.means.astype(np.float64)
    pixels, depth = calibration.camera.project(means)
    height, width = patch.shape
    around = grown(patch, touch_distance(patch) // 2)
    cells = np.round(np.clip(pixels, 0, (width - 1, height - 1))).astype(int)
    inside = np.flatnonzero(around[cells[:, 1], cells[:, 0]])
    if len(inside) == 0:
        away = ((pixels - centre_of(patch)) ** 2).sum(axis=1)
        inside = np.argsort(away, kind="stable")[: 4 * PER_GRIP]
    extent = float(np.ptp(means, axis=0).max())
    front = float(np.quantile(depth[inside], 0.02))
    inside = inside[depth[inside] <= front + GRASP_DEPTH * extent]
    return np.asarray(means[inside[_spread(means[inside])]], np.float64)


def _spread(points: Float64[Array, "m 3"]) -> Int[Array, " c"]:
    """Up to `PER_GRIP` of the points, far from each other, the most central first."""
    chosen = [int(np.argmin(((points - points.mean(axis=0)) ** 2).sum(axis=1)))]
    distance = ((points - points[chosen[0]]) ** 2).sum(axis=1)
    while len(chosen) < PER_GRIP and distance.max() > 0:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
    return np.array(chosen)


def _lift(
    paths: list[GripPath],
    rest: list[Float64[Array, "c 3"]],
    tracks: Tracks,
    calibration: Calibration,
    gaussians: Gaussians,
    key: int,
) -> list[Float64[Array, "T c 3"]]:
    """The grips' points in the world, from the keyframe on."""
    camera = calibration.camera
    centres = [points.mean(axis=0) for points in rest]
    pixels = [
        camera.project(centre)[0] + path.position - path.position[0]
        for centre, path in zip(centres, paths, strict=True)
    ]
    depths = [constant_depth(seen, centre, calibration) for seen, centre in zip(pixels, centres, strict=True)]
    places, resting = _resting_places(tracks, calibration, gaussians, key)
    ways = ways_through(gaussians, np.stack(centres), np.concatenate([places, np.stack(centres)]))
    for index, seen in enumerate(pixels):
        tethers = Tethers(places, ways[index, : len(places)], resting)
        depths[index] = tethered_depth(seen, depths[index], tethers, camera)
    if len(pixels) == 2:
        first, second = (camera.unproject(seen, depth) for seen, depth in zip(pixels, depths, strict=True))
        shrink = paired_scale(first, second, float(ways[0, len(places) + 1]))
        depths = [depth * shrink for depth in depths]
    motions = []
    for points, centre, seen, depth, path in zip(rest, centres, pixels, depths, paths, strict=True):
        middle = camera.unproject(seen, smooth_depth(depth))
        motions.append(middle[:, None] + _turned(points - centre, path.angle, calibration))
    return motions


def _turned(
    offsets: Float64[Array, "c 3"], angle: Float64[Array, " T"], calibration: Calibration
) -> Float64[Array, "T c 3"]:
    """Offsets turned about the optical axis as the grip turns in the image."""
    axes = calibration.camera.world_from_camera[:3, :3]
    cosine, sine = np.cos(angle), np.sin(angle)
    zero, one = np.zeros_like(angle), np.ones_like(angle)
    turn = np.stack([cosine, -sine, zero, sine, cosine, zero, zero, zero, one], axis=-1).reshape(-1, 3, 3)
    return np.asarray(np.einsum("ij,tjk,lk,cl->tci", axes, turn, axes, offsets), np.float64)


def _resting_places(
    tracks: Tracks, calibration: Calibration, gaussians: Gaussians, key: int
) -> tuple[Float64[Array, "M 3"], Bool[Array, "T M"]]:
    """Places of the object under tracks, and until when each has not moved since the keyframe."""
    count = len(tracks.points) - key
    if calibration.ground_height is None or tracks.points.shape[1] == 0:
        return np.zeros((0, 3)), np.zeros((count, 0), bool)
    pixels, depth = calibration.camera.project(gaussians.means)
    near = (
        cKDTree(pixels).query(tracks.points[key], min(8, len(pixels)))[1].reshape(tracks.points.shape[1], -1)
    )
    front = near[np.arange(len(near)), np.argmin(depth[near], axis=1)]
    moved = np.linalg.norm(tracks.points[key:] - tracks.points[key], axis=2)
    quiet = np.logical_and.accumulate((moved < STILL) & tracks.visible[key:], axis=0)
    return gaussians.means[front].astype(np.float64), quiet
