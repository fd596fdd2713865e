"""What something unseen held still, and when it is let go."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.bodies.let_go import after_let_go, let_go
from model.types import Observation


def noisy(seen, noise=1e-5):
    rng = np.random.default_rng(0)
    return replace(seen, points=seen.points + rng.normal(0, noise, seen.points.shape).astype(np.float32))


@pytest.mark.parametrize("held", [0.2, 0.5])
def test_a_bar_is_let_go(cantilever, held):
    seen = noisy(cantilever(held=held))
    first = let_go(seen)
    assert abs(seen.times[first] - held) <= 0.011
    after = after_let_go(seen)
    assert after.times[0] == seen.times[first]
    assert len(after.points) == len(after.controllers) == len(after.times)
    assert let_go(after) == 0


def test_a_bar_that_swings_from_the_start_was_not_held(cantilever):
    seen = noisy(cantilever(held=0.0))
    assert let_go(seen) == 0
    assert after_let_go(seen).points is not seen.points
    np.testing.assert_array_equal(after_let_go(seen).points, seen.points)


def test_nothing_that_stays_still_was_let_go(cantilever):
    seen = cantilever(held=0.5)
    assert let_go(noisy(replace(seen, points=np.repeat(seen.points[:1], len(seen.times), 0)))) == 0


def test_who_follows_a_hand_was_not_let_go(cantilever):
    """The hand drops, a moment later than the object as it were: an actuation that is reported late."""
    seen = noisy(cantilever(held=0.5))
    fall = np.minimum(0.0, -0.5 * 9.81 * np.maximum(seen.times - 0.55, 0.0) ** 2).clip(-0.3)
    hands = seen.controllers.copy()
    hands[..., 2] += fall[:, None].astype(np.float32)
    assert let_go(replace(seen, controllers=hands)) == 0


def test_who_rises_or_creeps_was_not_let_go(cantilever):
    seen = cantilever(held=0.5)
    up = replace(seen, points=2.0 * seen.points[:1] - seen.points)
    creeping = replace(seen, points=seen.points[:1] + 0.02 * (seen.points - seen.points[:1]))
    assert let_go(noisy(up)) == 0
    assert let_go(noisy(creeping)) == 0


def test_what_is_dropped_without_a_hand_was_held_too(cantilever):
    seen = cantilever(held=0.5)
    points = np.repeat(seen.points[:1], len(seen.times), 0)
    points[..., 2] -= 0.5 * 9.81 * np.maximum(seen.times - 0.5, 0.0).astype(np.float32)[:, None] ** 2
    dropped = noisy(replace(seen, points=points, controllers=seen.controllers[:, :0]))
    assert abs(dropped.times[let_go(dropped)] - 0.5) <= 0.011


def test_points_that_are_hidden_for_a_while_do_not_disturb(cantilever):
    seen = noisy(cantilever(held=0.5))
    points = seen.points.copy()
    points[10:20, 0] = np.nan
    points[:, 1] = np.nan
    assert abs(seen.times[let_go(replace(seen, points=points))] - 0.5) <= 0.011


def test_noise_that_passes_the_limit_is_no_fall(cantilever):
    """The hand holds it and it hangs still; of many noisy points one always seems to have fallen."""
    seen = cantilever(held=0.5)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        points = np.repeat(np.repeat(seen.points[:1], 40, 1), len(seen.times), 0)
        noise = rng.normal(0, 0.004, points.shape)
        for frame in range(1, len(noise)):
            noise[frame] = 0.8 * noise[frame - 1] + 0.6 * noise[frame]
        noise[..., 2] *= 1.5
        assert let_go(replace(seen, points=points + noise.astype(np.float32))) == 0


def test_a_fall_is_told_through_noise(cantilever):
    seen = cantilever(held=0.5)
    points = np.repeat(seen.points[:1], len(seen.times), 0)
    points[..., 2] -= 0.5 * 9.81 * np.maximum(seen.times - 0.5, 0.0).astype(np.float32)[:, None] ** 2
    dropped = noisy(replace(seen, points=points, controllers=seen.controllers[:, :0]), 0.003)
    assert abs(dropped.times[let_go(dropped)] - 0.5) <= 0.1


@pytest.mark.parametrize("rate", [15.0, 25.0, 30000 / 1001, 30.0, 60.0])
def test_a_fall_is_told_at_any_rate_of_frames(rate):
    """However many frames are in the time that is looked at, and however that is rounded."""
    times = np.arange(round(2.0 * rate)) / rate
    for frame in range(round(0.5 * rate), round(0.9 * rate)):
        assert let_go(_dropped(1, times, times[frame], 1e-5)) == frame


def test_a_fall_is_told_of_many_noisy_points():
    """One of them is always farther from its first place than one of a few would be."""
    dropped = _dropped(200, np.arange(60) / 30.0, 0.9, 0.001)
    assert abs(dropped.times[let_go(dropped)] - 0.9) <= 0.07


def _dropped(count, times, held, noise):
    rng = np.random.default_rng(0)
    points = np.repeat(rng.uniform(-0.1, 0.1, (1, count, 3)), len(times), 0)
    points[..., 2] -= 0.5 * 9.81 * np.maximum(times - held, 0.0)[:, None] ** 2
    points += rng.normal(0, noise, points.shape)
    return Observation(
        times=times, points=points.astype(np.float32), controllers=np.zeros((len(times), 0, 3), np.float32)
    )
