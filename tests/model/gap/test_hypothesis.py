"""What is free of a twin with effects, and how far it may go."""

import pytest

from model.gap.bodies.body import body_of
from model.gap.effects import GravityTilt, QuadraticAirDrag
from model.gap.estimate import Coordinates
from model.gap.hypothesis import Hypothesis
from model.gap.plain import PlainTwin

DRAG, TILT = "quadratic_air_drag.drag_per_mass", "gravity_tilt.about_x"


@pytest.fixture
def two(short):
    return Hypothesis(PlainTwin.of(body_of(short), short), (QuadraticAirDrag(), GravityTilt()))


def test_what_is_held_is_not_free(two):
    held = two.holding({DRAG: 2.0})
    assert set(two.quantities) - set(held.quantities) == {DRAG}


def test_limits_narrow_bounds_and_never_widen_them(two):
    within = two.within({DRAG: (1.0, 3.0), TILT: (-99.0, 0.1)})
    own = two.quantities
    assert within.quantities[DRAG].bounds == pytest.approx((1.0, 3.0), rel=0.01)
    low, high = within.quantities[TILT].bounds
    assert low == own[TILT].bounds[0]
    assert high == pytest.approx(0.1, abs=0.01)
    assert within.quantities["stiffness"] == own["stiffness"]


@pytest.mark.parametrize("value", [0.005, 1.0, 30.0])
def test_limits_that_leave_nothing_are_as_good_as_holding(two, value):
    """Also at the bounds; a fit's coordinates stay finite, and in order."""
    coordinates = Coordinates(two.within({DRAG: (value, value), TILT: (0.0, 0.0)}).quantities)
    low, high = coordinates.bounds
    assert (low < high).all()
    middle = coordinates.values(0.5 * (low + high))
    assert middle[DRAG] == pytest.approx(value, rel=0.01)
    assert middle[TILT] == pytest.approx(0.0, abs=0.01)
