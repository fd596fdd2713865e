"""Quantities as a vector, and back."""

import numpy as np
import pytest

from model.gap.coordinates import Coordinates
from model.gap.effects import QuadraticAirDrag, StrainStiffening
from model.gap.effects.base import Quantity

DRAG = {"drag_per_mass": QuadraticAirDrag.quantities["drag_per_mass"]}


def test_coordinates_go_there_and_back():
    coordinates = Coordinates({**StrainStiffening.quantities, **DRAG})
    values = {"stiffening": 7.0, "drag_per_mass": 0.2}
    assert coordinates.values(coordinates.vector(values)) == pytest.approx(values)
    low, high = coordinates.bounds
    beyond = coordinates.vector({"stiffening": 1e9, "drag_per_mass": 0.0})
    assert beyond[0] == high[0]
    assert beyond[1] == low[1]


def test_what_is_believed_is_told_in_coordinates():
    """A logarithm by itself, all else in quarters of the way between the bounds."""
    known = Quantity("1/s", (0.01, 20.0), 0.3, log=True, spread=1.5)
    even = Quantity("1", (-1.5, 1.5), 0.3, spread=0.15)
    coordinates = Coordinates({"drag": known, "gradient": even, **DRAG})
    np.testing.assert_allclose(coordinates.spreads, [1.5, 0.2, np.nan])
    np.testing.assert_allclose(coordinates.starts[:2], [np.log(0.3), 0.4])
