"""Two recordings say more of what an object is than one."""

import numpy as np

from model.gap.guessed_twin import guessed_twin
from model.types import Observation


def seen(places):
    points = np.repeat(places[None].astype(np.float32), 5, axis=0)
    return Observation(np.arange(5) / 30.0, points, np.zeros((5, 0, 3), np.float32), ground_height=0.0)


def test_what_lies_flat_in_the_other_recording_is_no_solid(egg):
    at = np.random.default_rng(0).uniform(0.0, 0.3, (150, 2))
    flat = seen(np.column_stack([at, np.zeros(150)]))
    bundle = seen(egg + np.array([0.0, 0.0, 0.5]))
    assert guessed_twin(bundle).body.shape == "solid"
    assert guessed_twin(bundle, bundle).body.shape == "solid"
    assert guessed_twin(bundle, flat).body.shape == "sheet"
