"""A cloth that lies spread out is nowhere thick."""

import numpy as np
import pytest

from model.gap.bodies.flat import lies_flat
from model.types import Observation


def lying(places, ground=0.0):
    noise = 1e-3 * np.random.default_rng(1).normal(size=(5, *places.shape))
    points = (places + noise).astype(np.float32)
    return Observation(np.arange(5) / 30.0, points, np.zeros((5, 0, 3), np.float32), ground_height=ground)


@pytest.fixture
def cloth():
    at = np.random.default_rng(0).uniform(0.0, 0.4, (150, 2))
    return np.column_stack([at, np.zeros(150)])


@pytest.mark.parametrize("ground", [0.0, -0.7])
def test_a_cloth_on_the_ground_lies_flat(cloth, ground):
    assert lies_flat(lying(cloth + np.array([0.0, 0.0, ground]), ground))


def test_what_is_thick_or_above_the_ground_does_not(cloth, egg):
    assert not lies_flat(lying(egg - [0.0, 0.0, egg[:, 2].min()]))
    assert not lies_flat(lying(cloth + np.array([0.0, 0.0, 0.05]))), "the top of a block"
    assert not lies_flat(lying(cloth[:, [0, 2, 1]])), "it hangs"
    assert not lies_flat(lying(cloth, None))
