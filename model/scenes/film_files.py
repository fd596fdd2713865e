"""What a film leaves in its folder (docs/scenes.md)."""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Bool, UInt8

from model.formats.files import check_writable, replacing
from model.formats.movie import encode_mp4
from model.scenes.case import Case
from model.types import Array, Camera

SCHEMA = "matphys.film/1"


def write_film(
    folder: Path,
    case: Case,
    *,
    camera: Camera,
    seed: int,
    materials: tuple[str, ...],
    pictures: Sequence[UInt8[Array, "H W 3"]],
    objects: Bool[Array, "T H W"],
    hands: Bool[Array, "T H W"],
    visible: Bool[Array, "T N"],
) -> Path:
    """Write film, camera, controllers, masks, tracks and, last, `film.json`; return the film.

    Raises:
        InputError: nothing can be written there.
    """
    film = folder / "film.mp4"
    check_writable(film)
    times = case.observation.times
    _write(film, encode_mp4(pictures, times))
    _write(folder / "camera.json", _camera(camera, case))
    with replacing(folder / "controllers.npz") as temporary:
        np.savez(temporary, controllers=case.observation.controllers, times=times)
    assert case.complete is not None
    pixels, depth = camera.project(case.complete)
    with replacing(folder / "tracks.npz") as temporary:
        np.savez(
            temporary,
            pixels=pixels.astype(np.float32),
            visible=visible,
            depth=depth.astype(np.float32),
            points=case.complete,
            part=case.topology.part[case.anchors.index[:, 0]],
            times=times,
        )
    for name, masks in (("object", objects), ("hand", hands)):
        for frame, mask in enumerate(masks):
            _, png = cv2.imencode(".png", mask.astype(np.uint8) * 255)
            _write(folder / name / f"{frame:04d}.png", png.tobytes())
    files = ("film.mp4", "camera.json", "controllers.npz", "tracks.npz")
    record = {
        "schema": SCHEMA,
        "case": case.name,
        "object": case.object_name,
        "class": case.object_class,
        "interaction": case.interaction,
        "shape": case.shape_class,
        "seed": seed,
        "width": camera.width,
        "height": camera.height,
        "frames": len(pictures),
        "fps": float((len(times) - 1) / (times[-1] - times[0])),
        "materials": list(materials),
        "sha256": {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in files},
    }
    _write(folder / "film.json", (json.dumps(record, indent=1) + "\n").encode())
    return film


def _camera(camera: Camera, case: Case) -> bytes:
    """As `--camera` reads it."""
    record = {
        "intrinsics": camera.intrinsics.tolist(),
        "width": camera.width,
        "height": camera.height,
        "world_from_camera": camera.world_from_camera.tolist(),
    }
    if case.observation.ground_height is not None:
        record["ground_height"] = case.observation.ground_height
    return (json.dumps(record, indent=1) + "\n").encode()


def _write(path: Path, content: bytes) -> None:
    with replacing(path) as temporary:
        temporary.write_bytes(content)
