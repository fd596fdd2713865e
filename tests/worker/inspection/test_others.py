"""What is refused is in `tests/service/hostile`; here: what is taken, and by which suffix."""

import io
import json

import cv2
import numpy as np
import pytest

from model.errors import InputError
from model.prompt import MAX_MASK_PIXELS
from model.reconstruction import camera_file, mesh_file
from worker.inspection import camera, controllers, depth, image, mesh, observation
from worker.inspection.verdict import BrokenFileError, UnknownFormatError


@pytest.fixture
def upload(tmp_path):
    def write(content: bytes):
        path = tmp_path / "upload"
        path.write_bytes(content)
        return path

    return write


def npy(values) -> bytes:
    target = io.BytesIO()
    np.save(target, values)
    return target.getvalue()


def npz(**arrays) -> bytes:
    target = io.BytesIO()
    np.savez(target, **arrays)
    return target.getvalue()


def test_the_limits_are_those_of_the_pipeline():
    assert image.MAX_PIXELS == MAX_MASK_PIXELS
    assert camera.KEYS == camera_file.KEYS
    assert camera.MAX_BYTES == camera_file.MAXIMUM_BYTES
    assert mesh.MAX_BYTES == mesh_file.MAXIMUM_BYTES


def test_a_mask(upload):
    assert image.inspect(upload(cv2.imencode(".png", np.zeros((48, 64), np.uint8))[1].tobytes())) == ".png"


def test_depth_as_an_image_and_as_an_array(upload):
    assert (
        depth.inspect(upload(cv2.imencode(".png", np.full((48, 64), 400, np.uint16))[1].tobytes())) == ".png"
    )
    assert depth.inspect(upload(npy(np.full((48, 64), 400.0)))) == ".npy"


@pytest.mark.parametrize("name", ["controllers", "controls"])
def test_controllers(upload, name):
    assert controllers.inspect(upload(npz(**{name: np.zeros((3, 2, 3), np.float32)}))) == ".npz"
    timed = npz(**{name: np.zeros((3, 0, 3))}, times=np.array([0, 0.1, 0.3]))
    assert controllers.inspect(upload(timed)) == ".npz"


def test_a_camera_as_the_pipeline_reads_it(upload):
    entries = {
        "intrinsics": {"fx": 90, "fy": 90.5, "cx": 32, "cy": 24},
        "width": 64,
        "height": 48,
        "world_from_camera": np.eye(4).tolist(),
        "ground_height": 0,
        "gravity": [0, 0, -9.81],
    }
    path = upload(json.dumps(entries).encode())
    assert camera.inspect(path) == ".json"
    assert camera_file.read_camera_file(path, 64, 48).ground_height == 0


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".glb"])
def test_a_mesh_as_the_pipeline_reads_it(upload, tmp_path, suffix):
    import trimesh

    content = trimesh.creation.box().export(file_type=suffix[1:])
    path = upload(content.encode() if isinstance(content, str) else content)
    assert mesh.inspect(path) == suffix
    mesh_file.read_mesh(path.rename(tmp_path / f"mesh{suffix}"))


def test_what_else_an_obj_may_have_is_no_other_file(upload, tmp_path):
    """A mark of its encoding, points, a face that goes on in the next line."""
    import trimesh

    faces = trimesh.creation.box().export(file_type="obj").replace(" 2 ", " \\\n2 ")
    path = upload(b"\xef\xbb\xbf" + faces.encode() + b"p 1\nvp 0.5\n")
    assert mesh.inspect(path) == ".obj"
    mesh_file.read_mesh(path.rename(tmp_path / "mesh.obj"))
    with pytest.raises(UnknownFormatError):
        mesh.inspect(upload(b"\xef\xbb\xbfv 0 0 0\nvoila\n"))


def seen(frames=4, count=5, **changes):
    still = np.linspace(0, 0.3, count * 3, dtype=np.float32).reshape(1, count, 3)
    arrays = {
        "times": np.arange(frames) / 30,
        "points": np.repeat(still, frames, axis=0),
        "controllers": np.zeros((frames, 0, 3), np.float32),
    } | changes
    return npz(**{name: value for name, value in arrays.items() if value is not None})


def test_an_observation(upload):
    assert observation.inspect(upload(seen())) == ".npz"


@pytest.mark.parametrize(
    ("content", "error", "line"),
    [
        (b"text", UnknownFormatError, "not a NPZ file"),
        (b"PK\x03\x04", InputError, "upload: expected a zip archive"),
        (seen(points=None), InputError, "upload: points: expected .* found no such key"),
        (seen(times=np.zeros(4)), InputError, "upload: times: expected strictly increasing"),
        (seen(points=np.full((4, 5, 3), np.nan)), InputError, "NaN everywhere"),
        (npz(times=np.array([object()])), InputError, "upload: times: expected numbers|expected an array"),
        (seen(frames=3001), BrokenFileError, "3001 frames of 5 points: at most 3000"),
        (seen(count=20_001), BrokenFileError, "4 frames of 20001 points"),
    ],
)
def test_what_is_no_observation(upload, content, error, line):
    with pytest.raises(error, match=line):
        observation.inspect(upload(content))


def test_a_number_beyond_all_floats_is_refused(upload):
    path = upload(b'{"intrinsics": [' + b"9" * 400 + b"]}")
    with pytest.raises(BrokenFileError, match="intrinsics: expected finite numbers"):
        camera.inspect(path)
