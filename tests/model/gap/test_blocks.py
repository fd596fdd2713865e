"""Residuals that hang together count for less, and intervals know it."""

import numpy as np
import pytest

from model.gap.belief import Belief
from model.gap.blocks import (
    block_length,
    blocks_of,
    correlation_time,
    drawn_frames,
    independent_share,
    jackknife,
    middle95,
)

FRAMES, POINTS = 400, 12


@pytest.fixture
def rng():
    return np.random.default_rng(5)


def remembering(rng, kept, shape=(FRAMES, POINTS, 3)):
    field = rng.normal(size=shape)
    for t in range(1, shape[0]):
        field[t] = kept * field[t - 1] + np.sqrt(1 - kept**2) * field[t]
    return field


def everywhere(field):
    return np.ones(field.shape[:2], bool)


def test_noise_without_memory_has_none(rng):
    field = remembering(rng, 0.0)
    assert correlation_time(field, everywhere(field)) == pytest.approx(1.0, abs=0.2)
    assert independent_share(field, everywhere(field)) > 0.8


def test_memory_is_what_theory_says(rng):
    field = remembering(rng, 0.8)
    assert correlation_time(field, everywhere(field)) == pytest.approx(9.0, rel=0.2)


def test_points_that_move_as_one_count_as_one(rng):
    field = np.repeat(remembering(rng, 0.0, (FRAMES, 1, 3)), POINTS, axis=1)
    assert independent_share(field, everywhere(field)) == pytest.approx(1.0 / POINTS, rel=0.15)


def test_what_is_not_seen_does_not_count(rng):
    field = remembering(rng, 0.0)
    seen = rng.random(field.shape[:2]) < 0.5
    whole = correlation_time(field * seen[..., None], seen)
    assert whole == pytest.approx(1.0, abs=0.2)


def test_silence_is_independent():
    field = np.zeros((10, 3, 3))
    assert independent_share(field, everywhere(field)) == 1.0


def test_a_bootstrap_draws_as_many_frames_in_blocks():
    times = drawn_frames(40, 5, draws=300)
    assert (times.sum(1) == 40).all()
    assert times.mean(0) == pytest.approx(np.ones(40), abs=0.3)
    apart = times - times.mean(0)
    together = (apart * np.roll(apart, 1, axis=1)).mean() / (apart**2).mean()
    assert together > 0.6  # 0.8 but for what wraps around; 0 without blocks


def test_blocks_are_not_too_few():
    assert block_length(100, 5) == 5
    assert block_length(40, 30) == 5
    assert block_length(3, 30) == 1
    block = blocks_of(np.array([1, 1, 2, 3, 4, 5, 6, 7]), 3)
    assert block.tolist() == [0, 0, 0, 0, 1, 1, 1, 1]


def test_a_jackknife_covers_where_residuals_are_taken_for_independent_it_does_not(rng):
    frames, covered, naive = np.arange(120), 0, 0
    for _ in range(200):
        noise = remembering(rng, 0.8, (120, 1, 1))[:, 0, 0]
        jacobian = np.stack([np.ones(120), remembering(rng, 0.8, (120, 1, 1))[:, 0, 0]], 1)
        solved = np.linalg.lstsq(jacobian, noise, rcond=None)[0]
        left = jacobian @ solved - noise
        block = blocks_of(frames, 12)
        parts = [(jacobian[block == b], left[block == b]) for b in range(10)]
        spread = jackknife(
            np.stack([j.T @ j for j, _ in parts]), np.stack([j.T @ r for j, r in parts]), np.zeros((2, 2))
        )
        covered += abs(solved[1]) < 2.26 * np.sqrt(spread[1, 1])
        usual = np.linalg.inv(jacobian.T @ jacobian)[1, 1] * (left**2).mean()
        naive += abs(solved[1]) < 1.96 * np.sqrt(usual)
    assert 0.88 < covered / 200 < 0.99
    assert naive / 200 < 0.75


def test_the_middle_holds_95_percent(rng):
    low, high = middle95(rng.normal(size=20000))
    assert (low, high) == pytest.approx((-1.96, 1.96), abs=0.06)


def test_what_no_block_speaks_of_is_known_as_well_as_before(rng):
    jacobian = np.stack([rng.normal(size=60), np.zeros(60)], 1)
    parts = [(jacobian[b::6], rng.normal(size=10)) for b in range(6)]
    normals, slopes = np.stack([j.T @ j for j, _ in parts]), np.stack([j.T @ r for j, r in parts])
    spread = jackknife(normals, slopes, np.eye(2) / 9.0)
    assert spread[1, 1] == pytest.approx(9.0)
    assert spread[0, 0] < 0.2


def test_points_that_are_never_seen_do_not_count(rng):
    field = rng.normal(size=(FRAMES, POINTS, 3))
    seen = everywhere(field)
    seen[:, ::2] = False
    field[~seen] = 0.0
    assert independent_share(field, seen) > 0.8


def test_what_is_believed_scatters_as_far_as_it_says(rng):
    """In whatever unit its residuals are: of a coordinate of which no block speaks that is all there is."""
    parts = [np.stack([rng.normal(size=10), np.zeros(10)], 1) for _ in range(6)]
    normals, slopes = np.stack([j.T @ j for j in parts]), np.stack([j.T @ rng.normal(size=10) for j in parts])
    believed = Belief(np.zeros(2), np.array([3.0, 0.2]), np.array([1.0, 40.0]))
    spread = jackknife(normals, slopes, believed.precision, believed.scatter)
    assert spread[1, 1] == pytest.approx(0.2**2)
