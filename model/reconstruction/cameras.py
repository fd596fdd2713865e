"""How the image relates to the metric, upright world: intrinsics, gravity, ground and scale.

Each is taken from the best source there is, and the result says which:

=========== =======================================================================================
what        sources, best first
=========== =======================================================================================
intrinsics  camera file; lines of the scene, where they fix the focal length; 70° assumed
gravity     pose in the camera file; plane fitted to depth; lines of the scene; a stated default
ground      camera file; z = 0 of a file's pose that the object's rays meet; the surface the object is
            seen to rest on; none
scale       depth; ``size_m`` given by the user; pose and ground of the camera file; 0.3 m assumed
=========== =======================================================================================

``size_m`` is the largest extent of the object on the keyframe, of a mesh the longest side of its box. Given
explicitly it overrules a camera file's pose (the camera then moves along its ray to the object until that has
this size), but not depth that is used, for it measures lengths: there it is ignored with a warning.
"""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float64

from model.errors import InputError
from model.reconstruction.camera_file import CameraFile, read_camera_file
from model.reconstruction.gravity import (
    Tilt,
    field_of_view_from_lines,
    intrinsics_for,
    tilt_from_lines,
)
from model.reconstruction.ground import ground_from_depth
from model.reconstruction.scale import DEFAULT_SIZE, Extent, centred, floating, ignored, meets, sized
from model.reconstruction.silhouette import check_seen
from model.reconstruction.support import Support, background_of, find_support
from model.types import STANDARD_GRAVITY, Array, Calibration, Camera, Frames, Masks

SMALLEST = 0.01
"""Longest side of an object [m]: what is smaller is nearer to its camera than renderers draw."""
DEFAULT_FIELD_OF_VIEW = np.deg2rad(70.0)
"""Of the longer side: between phones (65–70°) and depth cameras (70–90°)."""
TABLE_PITCH = np.deg2rad(50.0)
"""How far a camera over a table looks down."""
AIR_PITCH = np.deg2rad(15.0)
"""How far a camera looks down on a person holding something."""


def calibrate(
    frames: Frames,
    masks: Masks,
    *,
    camera_file: Path | None,
    size_m: float | None,
    extent: Extent,
    depth: Float[Array, "H W"] | None = None,
    shape_from_depth: bool = False,
) -> Calibration:
    """Fix camera, gravity, ground and scale for the keyframe.

    The world's origin lies on the ground below the object, x to the image's right and y into the depth,
    unless a camera file brings its own world and a ground in it. Without a ground it lies in the object's
    middle.

    Args:
        frames: The clip.
        masks: Object and hand.
        camera_file: See `model.reconstruction.camera_file` for the format.
        size_m: Largest extent of the object [m], if the user knows it.
        extent: Measures it in a world.
        depth: Depth of the keyframe [m], aligned to the colour image, 0 = missing; needs intrinsics.
        shape_from_depth: Whether the object is reconstructed from that depth, too, and so has its lengths.

    Raises:
        InputError: the camera file is wrong, the size is not a positive number, or the keyframe shows
            no object, or hardly any of it.
    """
    if size_m is not None and not (np.isfinite(size_m) and SMALLEST <= size_m <= 100.0):
        raise InputError(f"the size of the object must be between {SMALLEST} and 100 m, found {size_m}")
    key = masks.keyframe
    if not masks.object[key].any():
        raise InputError(f"{frames.name}: no object on keyframe {frames.number(key)}; give --mask or --box")
    check_seen(frames, masks)
    height, width = frames.images.shape[1:3]
    file = read_camera_file(camera_file, width, height) if camera_file else None
    if depth is not None and file is None:
        raise InputError("depth needs a camera file with the intrinsics it was taken with; give --camera")
    if file is not None and file.world_from_camera is not None:
        return _posed(frames, masks, file, size_m, extent, depth, shape_from_depth)
    if file is not None and depth is not None:
        return _from_depth(frames, masks, file, size_m, extent, depth)
    return _from_image(frames, masks, file, size_m, extent)


def _posed(
    frames: Frames,
    masks: Masks,
    file: CameraFile,
    size_m: float | None,
    extent: Extent,
    depth: Float[Array, "H W"] | None,
    shape_from_depth: bool,
) -> Calibration:
    """A pose is given: it fixes gravity, and with a ground also the scale."""
    assert file.world_from_camera is not None
    camera = _camera(file.intrinsics, file.world_from_camera, frames)
    ground, source = file.ground_height, "camera file"
    if ground is None and meets(camera, masks.object[masks.keyframe], 0.0):
        ground, source = 0.0, "plane z = 0 of the camera file's world, which the object's rays meet"
    calibration = Calibration(
        camera, file.gravity, ground, "pose and ground of the camera file", "camera file (pose)", source
    )
    if ground is None:
        unused = "the position in the camera file is not used, for no ground in view ties it to the object"
        calibration = replace(
            calibration,
            camera_source="camera file (intrinsics and rotation; position from the object)",
            ground_source="none: the camera file names no ground in view",
            warnings=(
                f"{unused}: the world's origin is the object's middle; give ground_height if there is one",
            ),
        )
        return floating(masks, calibration, size_m, extent, _object_depth(depth, masks))
    if not meets(camera, masks.object[masks.keyframe], ground):
        raise InputError(
            f"the camera file's ground_height {ground:g} is not where the camera looks at the object; check "
            "world_from_camera and the direction of gravity"
        )
    if shape_from_depth:
        return replace(calibration, scale_source="depth in millimetres", warnings=ignored(size_m))
    if depth is not None:
        unused = "depth is not used: the camera file's pose and ground fix the scale"
        calibration = replace(calibration, warnings=(unused,))
    return calibration if size_m is None else sized(masks, calibration, size_m, "stated", extent)


def _from_depth(
    frames: Frames,
    masks: Masks,
    file: CameraFile,
    size_m: float | None,
    extent: Extent,
    depth: Float[Array, "H W"],
) -> Calibration:
    """Gravity, ground and scale from the plane around the object in depth, else as held in the air."""
    key = masks.keyframe
    plane = ground_from_depth(depth, file.intrinsics, masks.object[key], masks.hand[key])
    if plane is None:
        result = _from_image(frames, masks, file, None, extent, grounded=False)
        result = replace(result, ground_source="none: no plane in the depth around the object")
        return floating(masks, result, size_m, extent, _object_depth(depth, masks))
    pose = _pose_over_ground(plane.up, plane.camera_height)
    camera = centred(_camera(file.intrinsics, pose, frames), masks.object[key])
    near = f"{plane.inliers:.0%} within {plane.tolerance * 1e3:.0f} mm"
    return Calibration(
        camera,
        file.gravity,
        0.0,
        "depth in millimetres",
        "intrinsics from the camera file, gravity from the plane under the object in depth",
        f"plane fitted to depth around the object ({near})",
        ignored(size_m),
    )


def _from_image(
    frames: Frames,
    masks: Masks,
    file: CameraFile | None,
    size_m: float | None,
    extent: Extent,
    grounded: bool = True,
) -> Calibration:
    """No pose: gravity from lines or a default, the ground from what the object rests on (if it may)."""
    support = find_support(frames, masks)
    if not grounded:
        support = replace(support, present=False)
    picture = background_of(frames) if support.static else frames.images[masks.keyframe]
    ignore = _grown(masks.object[masks.keyframe] | masks.hand[masks.keyframe], 9)
    default = TABLE_PITCH if support.present else AIR_PITCH
    if file is not None:
        intrinsics, lens = file.intrinsics, "intrinsics from the camera file"
    else:
        intrinsics, lens = _assumed_intrinsics(picture, ignore, default, support)
    tilt = tilt_from_lines(picture, ignore, intrinsics, float(default))
    doubts: tuple[str, ...] = ()
    if not tilt.reliable:
        angle = np.rad2deg(default)
        doubts = (f"the direction of gravity is a default: camera looks down {angle:.0f}° ({tilt.evidence})",)
    if not support.static:
        doubts = (*doubts, "the surroundings change: if it is the camera, film with one at rest")
    camera = _camera(intrinsics, _pose_over_ground(tilt.up, 1.0), frames)
    calibration = Calibration(
        camera,
        file.gravity if file else STANDARD_GRAVITY,
        0.0 if support.present else None,
        "",
        f"{lens}; {_tilt_source(tilt)}",
        f"{'estimated from the image' if support.present else 'none'}: {support.reason}",
        doubts,
    )
    if support.present and meets(camera, masks.object[masks.keyframe], 0.0):
        calibration = replace(calibration, camera=centred(camera, masks.object[masks.keyframe]))
        stated = "stated" if size_m is not None else "assumed"
        return sized(masks, calibration, size_m or DEFAULT_SIZE, stated, extent)
    if support.present:
        calibration = replace(calibration, ground_source="none: the object reaches above the horizon")
    return floating(masks, replace(calibration, ground_height=None), size_m, extent)


def _object_depth(depth: Float[Array, "H W"] | None, masks: Masks) -> float | None:
    """Median depth of the object on the keyframe [m], None where there is none."""
    if depth is None:
        return None
    measured = depth[masks.object[masks.keyframe] & (depth > 0)]
    return float(np.median(measured)) if len(measured) else None


def _assumed_intrinsics(
    picture: Array, ignore: Bool[Array, "H W"], default_pitch: float, support: Support
) -> tuple[Float64[Array, "3 3"], str]:
    """Intrinsics without a camera file, and the sentence that says where they come from."""
    height, width = picture.shape[:2]
    # A moving camera leaves no clean background; lines of people and things would mislead.
    seen = field_of_view_from_lines(picture, ignore, float(default_pitch)) if support.static else None
    if seen is not None:
        lens = f"field of view {np.rad2deg(seen):.0f}° along the longer side estimated from the scene's lines"
        return intrinsics_for(seen, width, height), lens
    angle = float(DEFAULT_FIELD_OF_VIEW)
    lens = f"field of view {np.rad2deg(angle):.0f}° assumed (longer side)"
    return intrinsics_for(angle, width, height), lens


def _tilt_source(tilt: Tilt) -> str:
    how = "from straight lines" if tilt.reliable else "by default"
    pitch, roll = np.rad2deg([tilt.pitch, tilt.roll])
    return f"looks down {pitch:.0f}°, roll {roll:.0f}°, {how} ({tilt.evidence})"


def _camera(intrinsics: Float64[Array, "3 3"], pose: Float64[Array, "4 4"], frames: Frames) -> Camera:
    return Camera(intrinsics, pose, width=frames.images.shape[2], height=frames.images.shape[1])


def _pose_over_ground(up: Float64[Array, " 3"], height: float) -> Float64[Array, "4 4"]:
    """Pose of a camera `height` [m] over z = 0, given up in its own coordinates."""
    ahead = np.array([0.0, 0.0, 1.0]) if abs(up[2]) < 0.98 else np.array([0.0, -1.0, 0.0])
    ahead = ahead - (ahead @ up) * up
    ahead = ahead / np.linalg.norm(ahead)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([np.cross(ahead, up), ahead, up])
    pose[2, 3] = height
    return pose


def _grown(mask: Bool[Array, "H W"], reach: int) -> Bool[Array, "H W"]:
    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)) > 0
