"""Changes of constants from residuals and responses: against planted ones."""

import numpy as np
import pytest

from model.encoders.response import NOISE, explain

BEFORE = np.array([2.0, 1.0, 0.7])


def scene(noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    response = rng.normal(0.0, 0.02, (3, 20, 30, 3))
    planted = np.array([1.0, -0.5, 0.3])
    residual = np.tensordot(planted, response, axes=1) + rng.normal(0.0, noise, (20, 30, 3))
    return planted, residual, response, np.ones((20, 30), bool)


def test_planted_changes_are_found():
    planted, residual, response, known = scene(noise=NOISE)
    answer = explain(residual, response, known, BEFORE)
    np.testing.assert_allclose(answer.change, planted, atol=0.02)
    assert (answer.spread < 0.1).all()


def test_error_says_how_much_is_left():
    _, residual, response, known = scene(noise=5e-3)
    assert explain(residual, response, known, BEFORE).error == pytest.approx(5e-3, rel=0.2)


def test_what_a_twin_cannot_follow_makes_unsure():
    first, second = (explain(*scene(noise=n)[1:], BEFORE).spread for n in (NOISE, 1e-2))
    assert (second > 3.0 * first).all()


def test_a_constant_that_does_nothing_stays_what_it_was():
    planted, residual, response, known = scene(noise=NOISE)
    residual = residual - planted[2] * response[2]
    response[2] = 0.0
    answer = explain(residual, response, known, BEFORE)
    assert answer.change[2] == 0.0
    assert answer.spread[2] == pytest.approx(BEFORE[2])


def test_nothing_known_is_nothing_learned():
    _, residual, response, known = scene()
    answer = explain(0.0 * residual, 0.0 * response, ~known, BEFORE)
    np.testing.assert_array_equal(answer.change, 0.0)
    np.testing.assert_array_equal(answer.spread, BEFORE)
