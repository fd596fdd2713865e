import json

import numpy as np
import pytest

from model.errors import InputError
from model.reconstruction.camera_file import read_camera_file

GOOD = {"fx": 400.0, "fy": 410.0, "cx": 319.5, "cy": 239.5}
POSE = [[1, 0, 0, 0.1], [0, 0, 1, -0.5], [0, -1, 0, 0.4], [0, 0, 0, 1]]


@pytest.fixture
def written(tmp_path):
    def write(**entries):
        path = tmp_path / "camera.json"
        path.write_text(json.dumps(entries))
        return path

    return write


def test_both_forms_of_intrinsics_mean_the_same(written):
    matrix = [[400.0, 0, 319.5], [0, 410.0, 239.5], [0, 0, 1]]
    first = read_camera_file(written(intrinsics=GOOD), 640, 480)
    second = read_camera_file(written(intrinsics=matrix), 640, 480)
    np.testing.assert_array_equal(first.intrinsics, second.intrinsics)
    np.testing.assert_array_equal(first.intrinsics, matrix)
    assert first.world_from_camera is None
    assert first.ground_height is None
    assert first.gravity == (0.0, 0.0, -9.81)


def test_intrinsics_follow_the_size_of_the_clip(written):
    file = read_camera_file(written(intrinsics=GOOD, width=640, height=480), 320, 240)
    # The middle of the image stays the middle; pixel centres are at whole numbers.
    np.testing.assert_allclose(file.intrinsics, [[200, 0, 159.5], [0, 205, 119.5], [0, 0, 1]])


def test_a_z_down_world_is_turned_upright(written):
    pose = np.diag([1.0, -1.0, -1.0, 1.0]) @ np.array(POSE)
    upright = read_camera_file(written(intrinsics=GOOD, world_from_camera=POSE, ground_height=0.1), 640, 480)
    down = read_camera_file(
        written(intrinsics=GOOD, world_from_camera=pose.tolist(), ground_height=0.1, gravity=[0, 0, 9.81]),
        640,
        480,
    )
    np.testing.assert_allclose(down.world_from_camera, upright.world_from_camera, atol=1e-12)
    assert down.gravity == upright.gravity
    assert down.ground_height == upright.ground_height == 0.1


def test_a_tilted_gravity_becomes_minus_z(written):
    gravity = np.array([1.0, 2.0, -9.0])
    file = read_camera_file(
        written(intrinsics=GOOD, world_from_camera=np.eye(4).tolist(), gravity=gravity.tolist()), 640, 480
    )
    assert file.gravity == pytest.approx((0.0, 0.0, -np.linalg.norm(gravity)))
    turned = file.world_from_camera[:3, :3] @ gravity
    np.testing.assert_allclose(turned, file.gravity, atol=1e-12)


SKEWED = [[1, 0, 0, 0], [0, 2, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
MIRRORED = [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ({}, "intrinsics"),
        ({"intrinsics": {**GOOD, "fx": float("nan")}}, "intrinsics.fx"),
        ({"intrinsics": {**GOOD, "fx": 10**400}}, "intrinsics.fx"),
        ({"intrinsics": [[10**400, 0, 0], [0, 400, 0], [0, 0, 1]]}, "intrinsics"),
        ({"intrinsics": {**GOOD, "fy": -3}}, "focal"),
        ({"intrinsics": {"fx": 1, "fy": 1, "cx": 1}}, "intrinsics.cy"),
        ({"intrinsics": [[1, 0], [0, 1]]}, "intrinsics"),
        ({"intrinsics": {**GOOD, "k1": -0.4}}, "intrinsics.k1"),
        ({"intrinsics": {**GOOD, "cx": 959.5}}, "principal point (959.5, 239.5) is outside"),
        ({"intrinsics": {**GOOD, "fx": 4.2}}, "sees 178° of the clip's 640 px"),
        ({"intrinsics": {**GOOD, "fx": 1e12}}, "give it in pixels"),
        ({"intrinsics": [[400, 0, float("nan")], [0, 400, 0], [0, 0, 1]]}, "intrinsics"),
        ({"intrinsics": [[400, 0, 0], [0, 400, 0], [0, 0, 2]]}, "intrinsics"),
        ({"intrinsics": "wide"}, "intrinsics"),
        ({"intrinsics": GOOD, "width": 480, "height": 640}, "width"),
        ({"intrinsics": GOOD, "width": 0, "height": 640}, "width"),
        ({"intrinsics": GOOD, "width": 640}, "height"),
        ({"intrinsics": GOOD, "world_from_camera": SKEWED}, "world_from_camera"),
        ({"intrinsics": GOOD, "world_from_camera": MIRRORED}, "world_from_camera"),
        ({"intrinsics": GOOD, "world_from_camera": [[1]]}, "world_from_camera"),
        ({"intrinsics": GOOD, "world_from_camera": POSE, "gravity": [0, 0, 0]}, "gravity"),
        ({"intrinsics": GOOD, "world_from_camera": POSE, "ground_height": "low"}, "ground_height"),
        ({"intrinsics": GOOD, "ground_height": 0.0}, "world_from_camera"),
        ({"intrinsics": GOOD, "distortion": [0]}, "distortion"),
    ],
)
def test_wrong_entries_are_named_in_one_line(written, entries, said):
    path = written(**entries)
    with pytest.raises(InputError) as caught:
        read_camera_file(path, 640, 480)
    message = str(caught.value)
    assert said in message
    assert str(path) in message
    assert "\n" not in message


@pytest.mark.parametrize("content", ["", "not json", "[1, 2]", "[" * 100_000])
def test_files_that_are_no_json_object_are_refused(tmp_path, content):
    path = tmp_path / "camera.json"
    path.write_text(content)
    with pytest.raises(InputError, match=r"camera\.json"):
        read_camera_file(path, 640, 480)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_camera_file(tmp_path / "none.json", 640, 480)
