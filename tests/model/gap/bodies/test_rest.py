"""Places of the first frame, told by all frames: less noise, and what a hand hid is put where it was."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from model.gap.bodies.first import first_places
from model.gap.bodies.rest import rest_places
from model.types import Observation

NOISE = 0.003
FRAMES = 60


def observed(points, controllers=None):
    hands = np.zeros((len(points), 0, 3)) if controllers is None else controllers
    return Observation(
        times=np.arange(len(points)) / 30.0,
        points=points.astype(np.float32),
        controllers=hands.astype(np.float32),
    )


@pytest.fixture
def sheet():
    """15 × 12 points of a flat sheet of 0.3 × 0.24 m."""
    u, v = np.meshgrid(np.linspace(0, 0.3, 15), np.linspace(0, 0.24, 12), indexing="ij")
    return np.stack([u, v, 0 * u], -1).reshape(-1, 3)


def waved(sheet):
    """The sheet turned, carried and slightly waved, frame by frame."""
    t = np.arange(FRAMES)[:, None] / 30.0
    wave = 0.01 * np.sin(20 * sheet[:, 0] + 6 * t) - 0.01 * np.sin(20 * sheet[:, 0])
    moved = sheet + np.stack([0 * wave, 0 * wave, wave], -1)
    turns = Rotation.from_rotvec(np.array([0.3, 0.8, 0.1]) * t)
    return np.stack([turn.apply(frame) for turn, frame in zip(turns, moved, strict=True)]) + 0.2 * t[:, None]


def rms(errors):
    return float(np.sqrt((errors**2).mean()))


def test_a_place_has_less_noise_than_one_frame(sheet):
    rng = np.random.default_rng(0)
    seen = observed(waved(sheet) + rng.normal(0, NOISE, (FRAMES, len(sheet), 3)))
    assert rms(first_places(seen) - sheet) == pytest.approx(NOISE, rel=0.1)
    assert rms(rest_places(seen) - sheet) < 0.55 * NOISE


def test_without_noise_a_place_stays_where_it_is_seen(sheet):
    assert rms(rest_places(observed(waved(sheet))) - sheet) < 3e-4


def test_what_a_hand_hides_at_first_is_put_where_it_was():
    """An end of a rope that is hidden until the hand has lifted it by 0.3 m; its neighbours still lie."""
    s = np.linspace(0, 0.6, 40)
    lying = np.stack([s, 0 * s, 0 * s], -1)
    lift = np.clip(np.arange(FRAMES) / 20.0, 0, 1)[:, None]
    up = 0.3 * lift * np.clip((s - 0.3) / 0.3, 0, 1)
    points = np.repeat(lying[None], FRAMES, 0)
    points[..., 2] += up
    points[..., 0] -= 0.1 * lift * np.clip((s - 0.3) / 0.3, 0, 1)
    rng = np.random.default_rng(1)
    points += rng.normal(0, 0.001, points.shape)
    hand = np.array([0.6, 0, 0.0]) + np.array([[0.01, 0, 0], [0, 0.01, 0.0], [0, 0, 0.01]])
    hands = hand + np.concatenate([-0.1 * lift, 0 * lift, 0.3 * lift], 1)[:, None]
    points[:20, 37:] = np.nan
    seen = observed(points, hands)
    assert np.abs(first_places(seen)[37:] - lying[37:]).max() > 0.015
    assert np.abs(rest_places(seen)[37:] - lying[37:]).max() < 0.008


def test_a_point_that_is_never_seen_has_no_place(sheet):
    points = waved(sheet)
    points[:, 5] = np.nan
    places = rest_places(observed(points))
    assert np.isnan(places[5]).all()
    assert np.isfinite(np.delete(places, 5, 0)).all()


def test_few_points_are_taken_as_they_are_seen(sheet):
    seen = observed(waved(sheet)[:, :5])
    np.testing.assert_array_equal(rest_places(seen), first_places(seen))


def test_where_nothing_is_seen_at_first_the_hand_alone_is_asked(sheet):
    points = waved(sheet)
    points[:20] = np.nan
    hands = np.repeat(np.array([[[0.3, 0.0, 0.0]]]), FRAMES, 0)
    assert np.isfinite(rest_places(observed(points, hands))).all()


def test_the_order_of_points_does_not_matter(sheet):
    rng = np.random.default_rng(2)
    points = waved(sheet) + rng.normal(0, NOISE, (FRAMES, len(sheet), 3))
    order = rng.permutation(len(sheet))
    one, other = rest_places(observed(points)), rest_places(observed(points[:, order]))
    np.testing.assert_allclose(one[order], other, atol=1e-6)


def test_turned_about_the_vertical_and_shifted_the_places_are_so_too(sheet):
    rng = np.random.default_rng(3)
    points = waved(sheet) + rng.normal(0, NOISE, (FRAMES, len(sheet), 3))
    turn, shift = Rotation.from_rotvec([0, 0, 1.1]), np.array([0.5, -1.0, 0.2])
    moved = turn.apply(points.reshape(-1, 3)).reshape(points.shape) + shift
    expected = turn.apply(rest_places(observed(points))) + shift
    np.testing.assert_allclose(rest_places(observed(moved)), expected, atol=1e-4)


def test_what_was_hidden_at_first_is_not_below_the_ground():
    """The middle of a rope, hidden by a hand, hangs 3 cm below its neighbours when it is seen again."""
    s = np.linspace(0, 0.6, 40)
    hidden = np.abs(s - 0.3) < 0.05
    lying = np.stack([s, 0 * s, np.full(40, 0.005)], -1)
    up = 0.3 * np.clip(np.arange(FRAMES) / 20.0, 0, 1)[:, None]
    points = lying + up[..., None] * np.array([0.0, 0.0, 1.0])
    points[10:, hidden, 2] -= 0.03
    points[:15, hidden] = np.nan
    seen = observed(points)
    unaware = rest_places(seen)
    assert unaware[hidden, 2].max() < 0.0, "nothing is below the ground where there is none"
    aware = rest_places(replace(seen, ground_height=0.0))
    assert (aware[:, 2] >= 0.0).all()
    assert np.allclose(aware[:, :2], unaware[:, :2], atol=0.01)
