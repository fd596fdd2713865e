import numpy as np

from model.gap.bodies.frames import frames_of
from model.types import Observation


def test_some_frames_of_a_recording_keep_all_else():
    points = np.arange(5 * 4 * 3, dtype=np.float32).reshape(5, 4, 3)
    whole = Observation(np.arange(5) / 30.0, points, 0.5 * points[:, :1], ground_height=0.1)
    some = frames_of(whole, slice(1, 4))
    np.testing.assert_array_equal(some.times, whole.times[1:4])
    np.testing.assert_array_equal(some.points, points[1:4])
    np.testing.assert_array_equal(some.controllers, 0.5 * points[1:4, :1])
    assert some.ground_height == 0.1
