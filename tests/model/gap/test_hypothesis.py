"""What is free of a twin with effects, and how far it may go."""

import numpy as np
import pytest

from model.gap.bodies.body import body_of
from model.gap.effects import GravityTilt, QuadraticAirDrag
from model.gap.hypothesis import Hypothesis
from model.gap.plain import PlainTwin

DRAG = "quadratic_air_drag.drag_per_mass"


@pytest.fixture
def two(short):
    return Hypothesis(PlainTwin.of(body_of(short), short), (QuadraticAirDrag(), GravityTilt()))


def test_what_is_held_is_not_free(two):
    held = two.holding({DRAG: 2.0})
    assert set(two.quantities) - set(held.quantities) == {DRAG}


def test_what_is_held_is_as_if_it_were_asked_for(two):
    values = {name: quantity.start for name, quantity in two.quantities.items()}
    free = {name: value for name, value in values.items() if name != DRAG}
    one, other = two.at(values), two.holding({DRAG: values[DRAG]}).at(free)
    np.testing.assert_array_equal(one.rollout(last=3).points, other.rollout(last=3).points)
