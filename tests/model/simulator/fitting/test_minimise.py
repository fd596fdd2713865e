"""Both minimisers: known minima, bounds, places that cannot be evaluated, and budgets."""

import numpy as np
import pytest

from model.simulator.fitting.gauss_newton import gauss_newton
from model.simulator.fitting.minimise import Goal, minimise, pushing

FREE = np.full(2, -10.0), np.full(2, 10.0)
GOAL = Goal(budget=200.0, left=1e-7, decrease=1e-12)


def valley(z):
    """Rosenbrock's residuals, moved so that the least loss is 1; minimum at (1, 1)."""
    return np.array([10.0 * (z[1] - z[0] ** 2), 1.0 - z[0], 1.0])


def slope(z):
    r = valley(z)
    jacobian = np.array([[-20.0 * z[0], 10.0], [-1.0, 0.0], [0.0, 0.0]])
    return float(r @ r), 2 * jacobian.T @ r


def by_gradients(residuals, gradient, start, bounds=FREE, goal=GOAL):
    return minimise(gradient, np.asarray(start, float), *bounds, goal)


def by_differences(residuals, gradient, start, bounds=FREE, goal=GOAL):
    return gauss_newton(residuals, np.asarray(start, float), *bounds, goal, 1)


BOTH = pytest.mark.parametrize("method", [by_gradients, by_differences])


@BOTH
def test_the_bottom_of_a_valley(method):
    found = method(valley, slope, [-1.2, 1.0])
    assert found.outcome == "converged"
    assert found.best.z == pytest.approx([1.0, 1.0], abs=2e-3)
    assert found.best.loss == pytest.approx(1.0, abs=1e-5)
    assert found.rejected == 0


@BOTH
def test_bounds_hold_and_push(method):
    bounds = np.array([-10.0, -10.0]), np.array([0.5, 10.0])
    found = method(valley, slope, [-1.2, 1.0], bounds)
    assert found.best.z == pytest.approx([0.5, 0.25], abs=2e-3)
    assert found.best.z[0] <= 0.5
    assert found.outcome == "converged"
    assert pushing(found.best.z, found.best.gradient, *bounds).tolist() == [True, False]


@BOTH
def test_a_start_outside_is_moved_to_the_bound(method):
    bounds = np.array([0.0, 0.0]), np.array([2.0, 2.0])
    assert method(valley, slope, [5.0, -3.0], bounds).best.z == pytest.approx([1.0, 1.0], abs=5e-3)


@BOTH
def test_what_is_not_finite_is_stepped_back_from(method):
    looked = []

    def within(function):
        def inside(z):
            looked.append(z.copy())
            return function(z) if z[0] < 1.05 else None

        return inside

    def bowl(z):
        return np.array([np.exp(2 * z[0]) - np.exp(2.0), z[1], 1.0])

    def bowl_slope(z):
        r = bowl(z)
        return float(r @ r), 2 * np.array([2 * np.exp(2 * z[0]) * r[0], r[1]])

    found = method(within(bowl), within(bowl_slope), [-1.0, 1.0])
    assert found.rejected > 0
    assert found.rejected <= sum(z[0] >= 1.05 for z in looked)
    assert found.best.z == pytest.approx([1.0, 0.0], abs=1e-2)


@BOTH
def test_nothing_finite_at_the_start(method):
    found = method(lambda z: None, lambda z: None, [0.0, 0.0])
    assert found.outcome == "diverged"
    assert found.best is None
    assert found.rejected == 1


@BOTH
@pytest.mark.parametrize("budget", [1.0, 4.0, 7.5])
def test_no_more_is_spent_than_there_is(method, budget):
    costs, losses = [], []
    goal = Goal(budget, 1e-12, 0.0)
    tell = lambda loss, cost: (costs.append(cost), losses.append(loss))  # noqa: E731
    start = np.array([-1.2, 1.0])
    if method is by_gradients:
        found = minimise(slope, start, *FREE, goal, tell)
    else:
        found = gauss_newton(valley, start, *FREE, goal, 1, tell)
    assert found.outcome == "budget"
    assert costs[-1] <= found.cost <= budget + 1e-6
    assert found.best.loss == min(losses)


def test_a_loss_that_no_longer_falls_has_stalled():
    def rough(z):
        """A slope that the loss does not have."""
        return 1.0 + 1e-9 * float(z @ z), np.array([1.0, 1.0])

    assert minimise(rough, np.ones(2), *FREE, Goal(200.0, 1e-3, 1e-6)).outcome == "stalled"
