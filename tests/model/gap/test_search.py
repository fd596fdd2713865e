"""An effect is found at whatever size it has, and what is at work comes first."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.effects import ActuationDelay, QuadraticAirDrag
from model.gap.meeting import able_effects
from model.gap.search import STRENGTHS, begun, searched, stepped, values_of

DRAG, DELAY = "quadratic_air_drag.drag_per_mass", "actuation_delay.delay"


@pytest.fixture
def dragged(hung, studied):
    return studied(hung, (QuadraticAirDrag(),), {DRAG: 4.0})


@pytest.fixture
def late(hung, studied):
    return studied(hung, (ActuationDelay(),), {DELAY: 0.2})


def test_what_is_at_work_comes_first(dragged):
    told = []
    found = searched(dragged, able_effects(dragged), told.append)
    assert next(iter(found)) == "quadratic_air_drag"
    left = [one.left for one in found.values()]
    assert left == sorted(left)
    assert told == sorted(told)
    assert 0.0 <= told[0] <= told[-1] < 1.0


def test_what_is_far_from_linear_comes_first_as_well(late):
    """A hand that is 0.2 s late, of which multiples of what 0.03 s do foretell little."""
    found = searched(late, able_effects(late))
    assert next(iter(found)) == "actuation_delay"
    values = values_of(late, ActuationDelay(), found["actuation_delay"])
    assert values == {DELAY: pytest.approx(0.2, abs=0.06)}


def test_a_beginning_is_the_best_of_all_strengths(dragged):
    effects = (QuadraticAirDrag(),)
    found = [begun(dragged, effects, [{DRAG: start}]) for start in (0.25, 1.0, 4.0, 64.0)]
    near = [values_of(dragged, effects[0], one)[DRAG] for one in found]
    assert all(abs(np.log(value / 4.0)) <= np.log(3.0) for value in near)
    together = begun(dragged, effects, [{DRAG: start} for start in (0.25, 64.0)])
    assert together.left == pytest.approx(min(found[0].left, found[-1].left))


def test_a_step_never_leaves_more(dragged):
    effects = (QuadraticAirDrag(),)
    misfit = dragged.misfit.of(replace(dragged.plain, effects=effects))
    start = begun(dragged, effects, [{DRAG: 1.0}])
    here = float((misfit(start.vector[None]) ** 2).mean())
    once = stepped(dragged, effects, start)
    assert once.left < here
    assert float((misfit(once.vector[None]) ** 2).mean()) == pytest.approx(once.left, rel=1e-6)
    best = once
    for _ in range(8):
        best = stepped(dragged, effects, best)
    assert best.left <= once.left


def test_two_effects_begin_each_at_its_own_strength(dragged):
    """Of the delay there is nothing: it begins as faint as it may, whatever suits the drag."""
    effects = QuadraticAirDrag(), ActuationDelay()
    both = begun(dragged, effects, [{DRAG: 1.0, DELAY: 0.04}])
    coordinates = dragged.misfit.of(replace(dragged.plain, effects=effects)).coordinates
    values = coordinates.values(both.vector)
    alone = values_of(dragged, effects[0], begun(dragged, effects[:1], [{DRAG: 1.0}]))
    assert values[DRAG] == pytest.approx(alone[DRAG])
    assert values[DELAY] == pytest.approx(STRENGTHS[0] * 0.04)
