from dataclasses import replace

import numpy as np
import pytest

from model.scenes.world.sensor import (
    TRACK_NOISE,
    Surface,
    choose,
    interrupted,
    lifted,
    look,
    measured_in_space,
    place_cameras,
    seen,
)
from model.views import look_at


@pytest.fixture
def ball():
    """A ball of 5 cm at rest, and its outward normals."""
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(1500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    places = 0.05 * normals + (0.0, 0.0, 0.1)
    still = [np.repeat(each[None], 3, axis=0).astype(np.float32) for each in (places, normals)]
    return Surface(still[0], still[1], 0.004)


@pytest.fixture
def camera():
    return look_at(np.array([0.5, 0.0, 0.1]), np.array([0.0, 0.0, 0.1]), 700.0, 640, 480)


def test_a_camera_sees_the_near_side_only(ball, camera):
    visible = seen(ball, np.zeros((3, 0, 3)), [camera])
    towards = ball.places[0, :, 0] / 0.05
    assert visible[0, towards > 0.3].mean() > 0.99
    assert not visible[0, towards < -0.05].any()


def test_a_cord_is_followed_whichever_side_it_shows(ball, camera):
    away = replace(ball, normals=-ball.normals, spacing=0.01)
    assert seen(away, np.zeros((3, 0, 3)), [camera])[0].mean() < 0.3
    assert seen(replace(away, thin=True), np.zeros((3, 0, 3)), [camera])[0].mean() > 0.4


def test_what_is_in_front_hides_what_is_behind(ball, camera):
    wall = ball.places.copy()
    wall[..., 0] += 0.2
    both = Surface(np.concatenate([ball.places, wall], axis=1), np.tile(ball.normals, (1, 2, 1)), 0.004)
    visible = seen(both, np.zeros((3, 0, 3)), [camera])
    count = ball.places.shape[1]
    assert visible[0, :count].mean() < 0.02
    assert visible[0, count:].mean() > 0.25


def test_a_hand_hides_what_it_holds_while_it_is_there(ball, camera):
    hands = np.array([[[0.08, 0.0, 0.08]], [[0.08, 0.0, 0.08]], [[0.08, 0.4, 0.08]]])
    share = seen(ball, hands, [camera]).mean(axis=1)
    assert share[0] < 0.6 * share[2]


def test_a_rig_sees_more_than_a_camera_and_views_show_the_object(ball):
    rng, nobody = np.random.default_rng(1), np.zeros((3, 0, 3))
    one = seen(ball, nobody, place_cameras(ball.places, 1, rng)).mean()
    three = seen(ball, nobody, place_cameras(ball.places, 3, rng)).mean()
    assert three > 1.5 * one
    (camera,) = look(ball, nobody, 1, rng)
    pixels, depth = camera.project(ball.places)
    assert (depth > 0).all()
    assert (pixels >= 0).all()
    assert (pixels < (640, 480)).all()


def test_chosen_points_are_seen_at_first_and_spread(ball, camera):
    visible = seen(ball, np.zeros((3, 0, 3)), [camera])
    chosen = choose(visible, ball.places[0].astype(np.float64), np.random.default_rng(0))
    assert len(chosen) == len(set(chosen.tolist())) == 150
    assert visible[0, chosen].all()


def test_tracks_are_lost_and_interrupted_but_begin(ball):
    kept = interrupted(np.ones((60, 400), bool), np.random.default_rng(0))
    assert kept[0].all()
    ended = (~kept[-1]).mean()
    assert 0.03 < ended < 0.15
    assert 0.9 < kept.mean() < 0.99
    assert not interrupted(np.zeros((10, 5), bool), np.random.default_rng(0)).any()


def test_depth_noise_is_a_millimetre_in_every_direction():
    still = np.zeros((50, 200, 3), np.float32)
    noise = measured_in_space(still, np.random.default_rng(0))
    np.testing.assert_allclose(noise.std(axis=(0, 1)), 0.001, rtol=0.05)


def test_one_camera_measures_across_its_sight_and_takes_the_depth_of_the_guess(camera):
    rng = np.random.default_rng(0)
    still = rng.uniform(-0.05, 0.05, (1, 200, 3)) + np.array([0.0, 0.0, 0.1])
    points = np.repeat(still, 40, axis=0).astype(np.float32)
    guess = points + np.float32([0.1, 0.0, 0.0])  # nearer to the camera by 10 cm
    found = lifted(points, guess, camera, rng)
    pixels, depth = camera.project(found)
    np.testing.assert_allclose(depth, camera.project(guess)[1], atol=1e-5)
    error = (pixels - camera.project(points)[0])[10:]
    assert error.std() == pytest.approx(TRACK_NOISE, rel=0.1)
    again = np.corrcoef(error[1:].ravel(), error[:-1].ravel())[0, 1]
    assert 0.4 < again < 0.8
