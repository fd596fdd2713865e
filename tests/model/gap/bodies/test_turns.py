"""The rotation nearest to a matrix."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from model.gap.bodies.turns import nearest_rotation


@pytest.mark.parametrize("many", [(), (4,), (2, 3)])
def test_points_that_turned_say_how_they_did(many):
    rng = np.random.default_rng(0)
    turns = Rotation.random(int(np.prod(many, dtype=int)), rng=rng).as_matrix().reshape(*many, 3, 3)
    before = rng.normal(size=(*many, 20, 3))
    after = before @ turns
    np.testing.assert_allclose(nearest_rotation(before.swapaxes(-1, -2) @ after), turns, atol=1e-12)


def test_a_mirror_is_no_rotation():
    """The nearest to it turns the way that matters least."""
    found = nearest_rotation(np.diag([3.0, 2.0, -1.0]))
    assert np.linalg.det(found) == pytest.approx(1.0)
    np.testing.assert_allclose(found, np.eye(3), atol=1e-12)
