import numpy as np
import pytest

from model.timing import evenly_timed


def motion_at(times):
    """Two controllers on straight lines: linear interpolation is exact."""
    start = np.array([[0.1, 0.2, 0.3], [-0.1, 0.0, 0.5]])
    velocity = np.array([[1.0, -2.0, 0.5], [0.0, 0.3, -0.7]])
    return (start + np.asarray(times)[:, None, None] * velocity).astype(np.float32)


@pytest.mark.parametrize("fps", [24.0, 30000 / 1001, 30.0])
def test_a_constant_rate_keeps_its_frames_to_the_last_digit(fps):
    times = np.round(np.arange(40) / fps * 90_000) / 90_000  # the clock of a container
    motion = np.random.default_rng(0).normal(size=(40, 3, 3)).astype(np.float32)
    rate = (len(times) - 1) / times[-1]
    np.testing.assert_array_equal(evenly_timed(motion, times, rate), motion)


def test_a_variable_rate_is_interpolated():
    times = np.array([0.0, 0.05, 0.08, 0.2, 0.3])
    even = evenly_timed(motion_at(times), times, 20.0)
    assert even.dtype == np.float32
    assert even.shape == (7, 2, 3)
    np.testing.assert_allclose(even, motion_at(np.arange(7) / 20.0), atol=1e-6)


def test_times_count_from_the_first():
    times = 5.0 + np.array([0.0, 0.02, 0.1])
    np.testing.assert_allclose(evenly_timed(motion_at(times), times, 10.0), motion_at([5.0, 5.1]), atol=1e-6)


def test_nothing_is_made_up_after_the_last_time():
    times = np.array([0.0, 0.11, 0.29])
    even = evenly_timed(motion_at(times), times, 10.0)
    np.testing.assert_allclose(even, motion_at([0.0, 0.1, 0.2]), atol=1e-6)


def test_no_controllers_stay_none():
    times = np.array([0.0, 0.05, 0.2])
    assert evenly_timed(np.zeros((3, 0, 3), np.float32), times, 20.0).shape == (5, 0, 3)
