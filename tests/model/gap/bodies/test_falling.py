"""What nothing bears falls at once."""

import numpy as np
import pytest

from model.gap.bodies.falling import falls
from model.types import Observation


def recording(share, fps=30.0, hidden=0.0):
    times = np.arange(15) / fps
    places = np.random.default_rng(0).uniform(0.5, 0.7, (30, 3))
    points = places[None] + share[None, :, None] * (-4.905 * times**2)[:, None, None] * [0.0, 0.0, 1.0]
    points[np.random.default_rng(1).random(points.shape[:2]) < hidden] = np.nan
    return Observation(times, points.astype(np.float32), np.zeros((15, 0, 3), np.float32), ground_height=0.0)


@pytest.mark.parametrize("fps", [10.0, 30.0, 240.0])
def test_what_is_let_go_falls_and_what_rests_does_not(fps):
    assert falls(recording(np.ones(30), fps))
    assert not falls(recording(np.zeros(30), fps))


def test_half_of_it_has_to_fall():
    share = np.repeat([1.0, 0.0], [20, 10])
    assert falls(recording(share))
    assert not falls(recording(share[::-1] * 0.2))


def test_what_is_seen_counts():
    assert falls(recording(np.ones(30), hidden=0.4))
    assert not falls(recording(np.ones(30), hidden=1.0))
