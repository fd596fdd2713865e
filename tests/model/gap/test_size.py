"""How large an object is, whichever way it is turned."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from model.gap.size import size_of


def test_a_box_is_as_large_as_its_diagonal():
    corners = np.stack(np.meshgrid([0, 0.3], [0, 0.4], [0, 1.2], indexing="ij"), -1).reshape(-1, 3)
    turned = corners @ Rotation.from_euler("xyz", (20, 50, 70), degrees=True).as_matrix().T + [5, 6, 7]
    assert size_of(corners) == pytest.approx(1.3)
    assert size_of(turned) == pytest.approx(1.3)
