"""Quantities as a vector, and back."""

import pytest

from model.gap.coordinates import Coordinates
from model.gap.effects import QuadraticAirDrag, StrainStiffening


def test_coordinates_go_there_and_back():
    coordinates = Coordinates({**StrainStiffening.quantities, **QuadraticAirDrag.quantities})
    values = {"stiffening": 7.0, "drag_per_mass": 0.2}
    assert coordinates.values(coordinates.vector(values)) == pytest.approx(values)
    low, high = coordinates.bounds
    beyond = coordinates.vector({"stiffening": 1e9, "drag_per_mass": 0.0})
    assert beyond[0] == high[0]
    assert beyond[1] == low[1]
