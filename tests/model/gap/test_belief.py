"""What is believed beside what is seen: it counts as much as it should, no more and no less."""

import numpy as np
import pytest

from model.gap.belief import LOOSE, Belief, residual_unit
from model.gap.estimate import descended
from model.gap.misfit import Residuals

FRAMES, POINTS = 400, 12


@pytest.fixture
def rng():
    return np.random.default_rng(0)


class Linear(Residuals):
    """Of a model that is linear in its coordinates."""

    def __init__(self, slopes, seen, believed):
        self.slopes, self.seen, self.believed = slopes, seen, believed

    @property
    def bounds(self):
        return np.full(self.slopes.shape[1], -50.0), np.full(self.slopes.shape[1], 50.0)

    def __call__(self, vectors):
        return vectors @ self.slopes.T - self.seen

    def jacobian(self, vector, width):
        return self.slopes

    def belief(self, residuals, around):
        return self.believed


def everywhere(field):
    return np.ones(field.shape[:2], bool)


def test_of_noise_alone_a_standard_deviation_counts_as_one_residual(rng):
    field = rng.normal(size=(FRAMES, POINTS, 3))
    assert residual_unit(field, everywhere(field)) == pytest.approx(1.0, rel=0.1)
    assert residual_unit(3.0 * field, everywhere(field)) == pytest.approx(3.0, rel=0.1)


def test_a_twin_that_is_closer_than_noise_is_not_trusted_more(rng):
    field = 0.1 * rng.normal(size=(FRAMES, POINTS, 3))
    assert residual_unit(field, everywhere(field)) >= 1.0


def test_what_says_the_same_again_and_again_counts_once(rng):
    once = rng.normal(size=(FRAMES, POINTS, 3))
    alone = residual_unit(once, everywhere(once))
    for_each_point = np.repeat(once, 4, axis=1)
    assert residual_unit(for_each_point, everywhere(for_each_point)) == pytest.approx(2.0 * alone, rel=0.1)
    # sums of the eight last frames: 1 + 2 (7 + 6 + ... + 1) / 8 of them say as much as one
    lasting = np.stack([once[i : i + 8].sum(0) for i in range(FRAMES - 8)]) / 8.0**0.5
    assert residual_unit(lasting, everywhere(lasting)) == pytest.approx(8.0**0.5 * alone, rel=0.25)


def test_points_that_were_not_seen_say_nothing(rng):
    field = rng.normal(size=(FRAMES, POINTS, 3))
    seen = everywhere(field)
    seen[:, ::2] = False
    field[~seen] = 0.0
    assert residual_unit(field, seen) == pytest.approx(1.0, rel=0.15)


def test_a_fit_ends_where_frames_and_belief_agree(rng):
    """Ridge regression in closed form."""
    slopes, seen = rng.normal(size=(60, 3)), rng.normal(size=60)
    belief = Belief(np.array([1.0, -2.0, 0.5]), np.array([0.1, 1.0, 10.0]), np.array([2.0, 3.0, 1.0]))
    found = descended(Linear(slopes, seen, belief), np.zeros(3), -seen, belief, 12)
    precision = (belief.unit / belief.spread) ** 2
    closed = np.linalg.solve(
        slopes.T @ slopes + np.diag(precision), slopes.T @ seen + precision * belief.centre
    )
    np.testing.assert_allclose(found.x, closed, atol=1e-5)


def test_what_frames_say_nothing_of_stays_where_it_is_believed_to_be(rng):
    slopes = np.stack([rng.normal(size=40), np.zeros(40)], 1)
    belief = Belief.loose(np.array([0.0, 1.5]))
    seen = slopes @ np.array([2.0, 0.0])
    found = descended(Linear(slopes, seen, belief), np.zeros(2), -seen, belief, 12)
    assert found.x[1] == pytest.approx(1.5, abs=1e-3)
    assert found.x[0] == pytest.approx(2.0, rel=0.02)
    np.testing.assert_array_equal(belief.weight, [1.0 / LOOSE] * 2)


def test_so_much_of_belief_is_right(rng):
    """Errors that hang together: with less of it fits follow them, with more nothing else."""
    off = {by: 0.0 for by in (0.0, 1.0 / 30.0, 1.0, 30.0)}
    for _ in range(150):
        true = 0.3 * rng.normal(size=2)
        # slopes and errors both change slowly, and points tell the same
        slow = np.stack([lasting(rng, 200) for _ in range(3)], 1)
        slopes = np.repeat(slow[:, :2], 5, axis=0)
        seen = np.repeat(2.0 * slow[:, 2], 5) + slopes @ true
        left = (np.repeat(2.0 * slow[:, 2], 5)).reshape(200, 5, 1)
        unit = residual_unit(left, everywhere(left))
        for by in off:
            weight = (by * unit / 0.3) ** 2
            found = np.linalg.solve(slopes.T @ slopes + weight * np.eye(2), slopes.T @ seen)
            off[by] += ((found - true) ** 2).sum()
    assert off[1.0] < 0.8 * min(off[0.0], off[1.0 / 30.0], off[30.0])


def lasting(rng, frames, memory=0.95):
    values = [rng.normal()]
    for _ in range(frames - 1):
        values.append(memory * values[-1] + (1.0 - memory**2) ** 0.5 * rng.normal())
    return np.array(values)
