import base64
from datetime import datetime

import cv2
import numpy as np
import pytest

from model.manifest import describe_parts, with_metrics, write_manifest
from model.priors.materials import MATERIALS
from model.types import (
    Calibration,
    Camera,
    Estimate,
    Frames,
    MaterialPrior,
    Parameters,
    Parts,
    PartView,
    Topology,
)

FRAMES = Frames(np.zeros((4, 20, 30, 3), np.uint8), np.arange(4) / 25.0, "clip.mp4", "ab" * 32)
CALIBRATION = Calibration(
    Camera(np.array([[40.0, 0, 15], [0, 40.0, 10], [0, 0, 1]]), np.eye(4), 30, 20),
    (0.0, 0.0, -9.81),
    0.0,
    "the user said 0.3 m",
    "a guess",
    "the table",
)


def test_the_manifest_says_where_everything_comes_from():
    manifest = write_manifest(FRAMES, 2, CALIBRATION, {"seed": 0})
    source = manifest.source
    assert (source.name, source.sha256, source.keyframe) == ("clip.mp4", "ab" * 32, 2)
    assert (source.fps, source.frames, source.width, source.height) == (pytest.approx(25.0), 4, 30, 20)
    assert (source.scale, source.gravity, source.ground) == ("the user said 0.3 m", "a guess", "the table")
    assert source.camera is not None
    np.testing.assert_array_equal(source.camera.intrinsics, CALIBRATION.camera.intrinsics)
    assert manifest.created is not None
    assert datetime.fromisoformat(manifest.created).tzinfo is not None


def test_the_id_follows_from_clip_and_options_alone():
    one = write_manifest(FRAMES, 2, CALIBRATION, {"seed": 0}).id
    assert one == write_manifest(FRAMES, 1, CALIBRATION, {"seed": 0}).id
    assert one != write_manifest(FRAMES, 2, CALIBRATION, {"seed": 1}).id


def test_further_metrics_take_the_place_of_those_of_their_name():
    first = with_metrics(write_manifest(FRAMES, 2, CALIBRATION, {}), {"points": 3, "springs": 2})
    assert with_metrics(first, {"springs": 9}).metrics == {"points": 3, "springs": 9}
    assert first.metrics == {"points": 3, "springs": 2}


def described():
    """Three points in a row 1 cm apart; the last one is of the other part."""
    topology = Topology(
        points=np.array([[0, 0, 0], [0.01, 0, 0], [0.02, 0, 0]], np.float32),
        mass=np.array([1.0, 2.0, 4.0], np.float32),
        springs=np.array([[0, 1], [1, 2]], np.int32),
        rest_length=np.full(2, 0.01, np.float32),
        part=np.array([0, 0, 1], np.int32),
        binding_index=np.zeros((5, 1), np.int32),
        binding_weight=np.ones((5, 1), np.float32),
        controller_points=np.zeros((0, 3), np.float32),
        controller_springs=np.zeros((0, 2), np.int32),
        controller_rest_length=np.zeros(0, np.float32),
    )
    parameters = Parameters(np.array([30.0, 70.0], np.float32), np.zeros(0, np.float32), {})
    distribution = np.zeros(10)
    distribution[:2] = 0.25, 0.75
    prior = MaterialPrior(distribution, {"stiffness": Estimate(1e4, 0.5, "Pa")}, "solid")
    mask = np.zeros((20, 30), bool)
    mask[5:10, 5:10] = True
    views = [PartView(FRAMES.images[0], mask, mask, f"part {part}") for part in range(2)]
    parts = Parts(np.array([0, 0, 0, 1, 1], np.int32), 2)
    return describe_parts(views, [prior, prior], parts, topology, parameters)


def test_parts_say_what_they_are_made_of_and_how_large_they_are():
    first, second = described()
    assert (first.label, second.label) == ("part 0", "part 1")
    assert sum(first.materials.values()) == pytest.approx(1.0)
    assert first.materials[MATERIALS[1]] == 0.75
    assert first.prior["stiffness"].model_dump() == {"mean": 1e4, "spread": 0.5, "unit": "Pa"}
    assert first.size is not None
    assert second.size is not None
    assert (first.size.points, first.size.gaussians, first.size.mass) == (2, 3, 3.0)
    assert first.size.extent == pytest.approx((0.01, 0, 0))
    assert (second.size.points, second.size.gaussians, second.size.mass) == (1, 2, 4.0)


def test_springs_between_parts_are_of_neither():
    first, second = described()
    assert first.stiffness is not None
    assert second.stiffness is not None
    assert (first.stiffness.springs, first.stiffness.mean, first.stiffness.median) == (1, 30.0, 30.0)
    assert (second.stiffness.springs, second.stiffness.mean) == (0, None)


def test_the_overlay_is_a_picture_of_the_keyframe():
    overlay = described()[0].overlay
    assert overlay is not None
    image = cv2.imdecode(np.frombuffer(base64.b64decode(overlay), np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
