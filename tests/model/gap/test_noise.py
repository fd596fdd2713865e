"""How noisy places are: noise that lasts, points that flicker, and motion that is not noise."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from model.gap.noise import QUIETEST, UNKNOWN, noise_of
from model.types import Observation

FRAMES, NOISE = 90, 0.003


def observed(points):
    return Observation(
        times=np.arange(len(points)) / 30.0,
        points=points.astype(np.float32),
        controllers=np.zeros((len(points), 0, 3), np.float32),
    )


def waving(hertz=1.0, height=0.1):
    """A sheet of 0.4 m of 64 points, through which a wave goes."""
    u, v = np.meshgrid(np.linspace(0, 0.4, 8), np.linspace(0, 0.4, 8), indexing="ij")
    flat = np.stack([u, v, 0 * u], -1).reshape(-1, 3)
    times = np.arange(FRAMES)[:, None] / 30.0
    wave = height * np.sin(2 * np.pi * hertz * times + 6 * flat[:, 0])
    return flat + np.stack([wave, 0.3 * wave, wave], -1)


def noise(memory, count=64, frames=FRAMES, seed=0):
    """Of variance 1, with a correlation of `memory` from frame to frame."""
    made = np.random.default_rng(seed).normal(0, 1, (frames, count, 3))
    for frame in range(1, frames):
        made[frame] = memory * made[frame - 1] + np.sqrt(1 - memory**2) * made[frame]
    return made


def flickering(points, share, seed=0):
    hidden = points.copy()
    hidden[np.random.default_rng(seed).random(points.shape[:2]) < share] = np.nan
    return hidden


def told(memory, share=0.0, size=NOISE):
    """Mean over five recordings, over the truth."""
    found = [
        noise_of(observed(flickering(waving() + size * noise(memory, seed=seed), share, seed)))
        for seed in range(5)
    ]
    return float(np.mean(found)) / size


@pytest.mark.parametrize(
    ("memory", "low", "high"),
    [(0.0, 0.95, 1.1), (0.2, 0.9, 1.1), (0.5, 0.85, 1.1), (0.7, 0.8, 1.15), (0.85, 0.6, 1.2)],
)
def test_noise_that_lasts_is_as_large_as_noise_that_does_not(memory, low, high):
    assert low < told(memory) < high


@pytest.mark.parametrize("size", [0.0005, 0.001, 0.005])
def test_white_noise_of_any_size_is_told(size):
    assert told(0.0, size=size) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("share", [0.2, 0.4, 0.5])
def test_flickering_points_are_not_quiet(share):
    assert told(0.0, share) == pytest.approx(1.0, abs=0.15)
    assert told(0.5, share) > 0.55


@pytest.mark.parametrize("share", [0.7, 0.8])
def test_where_points_are_seldom_seen_in_a_row_the_noise_is_about_told(share):
    assert 0.5 < told(0.0, share) < 2.0


@pytest.mark.parametrize("hertz", [0.5, 1.0, 2.0])
def test_motion_is_no_noise(hertz):
    assert noise_of(observed(waving(hertz))) < 1.5 * QUIETEST


@pytest.mark.parametrize("hertz", [4.0, 5.0, 6.0, 8.0])
def test_shaking_does_not_pass_for_memory(hertz):
    """Third differences of a fast wave are large, and larger over more frames, as those of lasting noise."""
    moved = waving(hertz)
    third = np.linalg.norm(np.diff(moved, n=3, axis=0), axis=-1)
    assert noise_of(observed(moved)) < np.median(third) / 1.5382 / np.sqrt(20.0)


def test_moving_does_not_add_noise():
    for hertz, height in ((1.0, 0.1), (2.0, 0.1), (4.0, 0.05), (6.0, 0.02)):
        seen = observed(waving(hertz, height) + 0.001 * noise(0.0))
        assert noise_of(seen) == pytest.approx(0.001, rel=0.12)


def test_a_turned_shifted_or_reordered_recording_is_as_noisy():
    points = flickering(waving() + NOISE * noise(0.6), 0.1)
    seen = noise_of(observed(points))
    turn = Rotation.from_rotvec([0.3, -0.8, 1.1])
    turned = turn.apply(points.reshape(-1, 3)).reshape(points.shape)
    assert noise_of(observed(turned)) == pytest.approx(seen, rel=1e-3)
    assert noise_of(observed(points + np.array([1.0, -0.5, 0.3]))) == pytest.approx(seen, rel=1e-3)
    order = np.random.default_rng(1).permutation(points.shape[1])
    assert noise_of(observed(points[:, order])) == pytest.approx(seen, rel=1e-9)


@pytest.mark.parametrize("count", [1, 2, 3, 8])
def test_few_points_are_enough(count):
    found = [
        noise_of(observed(waving()[:, 10 : 10 + count] + NOISE * noise(0.0, count, seed=seed)))
        for seed in range(8)
    ]
    assert np.mean(found) / NOISE == pytest.approx(1.0, abs=0.2)


def test_lack_of_sightings_is_no_precision():
    points = waving() + NOISE * noise(0.0)
    in_turns = np.full_like(points, np.nan)
    for frame in range(FRAMES):
        in_turns[frame, frame % 3 :: 3] = points[frame, frame % 3 :: 3]
    assert 0.5 * NOISE < noise_of(observed(in_turns)) < 3.0 * NOISE
    assert noise_of(observed(points[:3])) == UNKNOWN
    seen = observed(np.full_like(points, np.nan))
    assert noise_of(replace(seen, points=seen.points)) == UNKNOWN
