"""Motion features say what a body is made of, and look at nothing that they may not see."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from model.encoders.kinematic import MIDDLE, WIDTH, KinematicEncoder
from model.errors import InputError
from model.predictor.motion import describe_motion
from model.types import Camera

DENSITY = 150.0
PART = KinematicEncoder.PART_FEATURES


def describe(case, **changes):
    given = {
        "topology": case.topology,
        "shape_class": case.shape_class,
        "rest": case.rest,
        "anchors": case.anchors,
        "observation": case.observation,
        "camera": case.camera,
        "frames": case.split,
        "encoder": KinematicEncoder(),
    }
    return describe_motion(**{**given, **changes})


def moduli(case, features):
    """What the part features say of E [Pa] by place, in each part."""
    of_part = [features.points[np.flatnonzero(case.topology.part == k)[0], -PART] for k in (0, 1)]
    return DENSITY * np.exp(MIDDLE + WIDTH * np.array(of_part))


def front(distance=0.8):
    """A camera that looks along +y."""
    pose = np.eye(4)
    pose[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    pose[:3, 3] = (0.07, -distance, 0.1)
    return Camera(np.array([[600.0, 0, 240], [0, 600, 180], [0, 0, 1]]), pose, 480, 360)


@pytest.fixture(scope="module")
def soft(make_case):
    return make_case(seed=1, modulus=(3e3, 3e3), frames=24, noise=5e-4)


@pytest.fixture(scope="module")
def soft_features(soft):
    return describe(soft)


def test_features_have_the_sizes_that_the_encoder_says(soft, soft_features):
    encoder = KinematicEncoder()
    assert soft_features.points.shape == (len(soft.topology.points), encoder.dim)
    assert soft_features.whole.shape == (encoder.global_dim,)
    assert np.isfinite(soft_features.points).all()
    assert np.isfinite(soft_features.whole).all()


def test_modulus_of_a_uniform_body_is_found_within_a_half(soft, soft_features):
    np.testing.assert_allclose(np.log(moduli(soft, soft_features)), np.log(3e3), atol=0.45)


def test_which_end_is_softer_is_seen_whatever_the_prior_says(make_case):
    for modulus in ((3e3, 2e4), (2e4, 3e3)):
        case = make_case(seed=2, modulus=modulus, frames=36, noise=5e-4)
        first, second = moduli(case, describe(case))
        assert (first < second) == (modulus[0] < modulus[1])


def test_the_future_is_not_looked_at(soft, soft_features):
    points, controls = soft.observation.points.copy(), soft.observation.controllers.copy()
    points[soft.split :] += 1.0
    controls[soft.split :] += 1.0
    other = describe(soft, observation=replace(soft.observation, points=points, controllers=controls))
    np.testing.assert_array_equal(other.points, soft_features.points)
    np.testing.assert_array_equal(other.whole, soft_features.whole)


def test_the_prior_is_not_looked_at_but_motion_is(soft, soft_features, make_case):
    stiff = make_case(seed=1, modulus=(3e4, 3e4), frames=24, noise=5e-4)
    assert moduli(stiff, describe(stiff)).min() > 2.0 * moduli(soft, soft_features).max()


def test_shift_and_turn_about_the_vertical_change_nothing(soft, soft_features):
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], np.float32)
    shift = np.array([0.5, -0.25, 0.0], np.float32)
    seen, topology = soft.observation, soft.topology
    moved = describe(
        soft,
        topology=replace(
            topology,
            points=topology.points @ turn.T + shift,
            controller_points=topology.controller_points @ turn.T + shift,
        ),
        rest=soft.rest @ turn.T + shift,
        observation=replace(
            seen, points=seen.points @ turn.T + shift, controllers=seen.controllers @ turn.T + shift
        ),
    )
    np.testing.assert_allclose(moved.points, soft_features.points, atol=0.05)
    np.testing.assert_allclose(moved.whole, soft_features.whole, atol=0.05)


def test_order_of_the_observed_points_changes_nothing(soft, soft_features):
    order = np.random.default_rng(0).permutation(len(soft.rest))
    anchors = replace(soft.anchors, index=soft.anchors.index[order], weight=soft.anchors.weight[order])
    seen = replace(soft.observation, points=soft.observation.points[:, order])
    other = describe(soft, rest=soft.rest[order], anchors=anchors, observation=seen)
    np.testing.assert_allclose(other.points, soft_features.points, atol=1e-3)


def test_depth_that_one_camera_guessed_does_not_count(soft):
    camera = front()
    pixels, depth = camera.project(soft.observation.points)
    wrong = camera.unproject(pixels, depth + 0.02).astype(np.float32)
    right = camera.unproject(pixels, depth).astype(np.float32)
    first, second = (
        describe(soft, camera=camera, observation=replace(soft.observation, points=points))
        for points in (right, wrong)
    )
    # 2 cm along the line of sight are still seen 2 % larger
    np.testing.assert_allclose(np.log(moduli(soft, first)), np.log(moduli(soft, second)), atol=0.25)
    np.testing.assert_allclose(np.log(moduli(soft, first)), np.log(3e3), atol=0.4)


def test_gaps_are_survived(soft):
    points = soft.observation.points.copy()
    points[np.random.default_rng(0).random(points.shape[:2]) < 0.4] = np.nan
    points[:, :12] = np.nan
    found = moduli(soft, describe(soft, observation=replace(soft.observation, points=points)))
    np.testing.assert_allclose(np.log(found), np.log(3e3), atol=0.5)


def test_nothing_seen_is_nothing_known(soft):
    blind = replace(soft.observation, points=np.full_like(soft.observation.points, np.nan))
    features = describe(soft, observation=blind)
    assert np.isfinite(features.points).all()
    assert np.isfinite(features.whole).all()
    sure = features.points[0, -PART:][[2, 5, 8]]
    np.testing.assert_allclose(sure, 0.0, atol=1e-6)


def test_an_object_that_nobody_holds(soft):
    none = np.zeros((len(soft.observation.times), 0, 3), np.float32)
    loose = replace(
        soft.topology,
        points=soft.topology.points + np.float32([0, 0, 0.2]),
        controller_points=np.zeros((0, 3), np.float32),
        controller_springs=np.zeros((0, 2), np.int32),
        controller_rest_length=np.zeros(0, np.float32),
    )
    seen = replace(soft.observation, controllers=none)
    features = describe(soft, topology=loose, rest=soft.rest + np.float32([0, 0, 0.2]), observation=seen)
    assert np.isfinite(features.points).all()


def test_a_hand_that_jerks_neither_warns_nor_breaks(soft):
    controls = soft.observation.controllers.copy()
    controls[1::2] += np.float32([0.0, 0.3, 0.5])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        features = describe(soft, observation=replace(soft.observation, controllers=controls))
    assert np.isfinite(features.points).all()


def test_too_few_frames_are_refused(soft):
    with pytest.raises(InputError, match="at least 4 of the 24"):
        describe(soft, frames=3)


@pytest.mark.parametrize("thinned", [2, 3])
def test_a_film_of_fewer_frames_a_second_says_the_same(thinned, make_case):
    case = make_case(seed=1, modulus=(3e3, 3e3), frames=60, noise=5e-4)
    seen = case.observation
    fewer = replace(
        seen,
        times=seen.times[::thinned],
        points=seen.points[::thinned],
        controllers=seen.controllers[::thinned],
    )
    all_frames = describe(case, frames=49)
    some = describe(case, observation=fewer, frames=48 // thinned + 1)
    # how far, fast and jerkily it moved, how it bent, its size, how much of a fall a frame is
    np.testing.assert_allclose(some.whole[-7:], all_frames.whole[-7:], atol=0.2)
    np.testing.assert_allclose(np.log(moduli(case, some)), np.log(moduli(case, all_frames)), atol=0.4)
