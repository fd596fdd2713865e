"""Loss and gradient at a place of the search."""

from dataclasses import replace

import numpy as np
import pytest

from model.simulator.fitting.objective import Look, Objective
from model.simulator.fitting.unknown import Gaussian, seek


@pytest.fixture
def objective(chain, watched):
    def build(backend="kernel"):
        scene = chain(25.0, frames=3)
        scene = replace(scene, simulator=scene.simulator.with_backend(backend))
        unknowns = [
            seek(scene, "spring.stiffness", prior=Gaussian(30.0, 0.5)),
            seek(scene, "drag.drag_rate", prior=Gaussian(1.0, 2.0)),
            seek(scene, "state.velocities"),
        ]
        return Objective(scene, unknowns, watched(chain(frames=3)))

    return build


LOOK = Look(2, 70, True)


def test_the_gradient_is_that_of_finite_differences(objective):
    made = objective()
    z = made.start
    loss, gradient = made.evaluate(z, LOOK)
    assert made.names()[:3] == ["spring.stiffness", "drag.drag_rate", "state.velocities"]
    assert len(z) == 26
    for number in (0, 1, 2, 19):
        step = 1e-5 * np.eye(len(z))[number]
        ahead, behind = (made.evaluate(z + sign * step, LOOK)[0] for sign in (1, -1))
        assert (ahead - behind) / 2e-5 == pytest.approx(gradient[number], rel=1e-4, abs=1e-6 * loss)


def test_the_loss_is_the_mean_square_of_the_residuals(objective):
    made = objective()
    residuals = made.residuals(made.start, LOOK)
    assert residuals @ residuals / made.count(LOOK) == pytest.approx(made.evaluate(made.start, LOOK)[0])
    assert len(residuals) == 3 * 8 * 3 + 2


def test_the_oracle_says_the_same(objective):
    (loss, gradient), (slow, expected) = (
        objective(backend).evaluate(objective().start, LOOK) for backend in ("kernel", "torch")
    )
    assert loss == pytest.approx(slow, rel=1e-10)
    np.testing.assert_allclose(gradient, expected, rtol=1e-7, atol=1e-8 * np.abs(expected).max())


def test_values_that_need_more_substeps_get_them(objective):
    made = objective()
    stiff = made.start.copy()
    stiff[0] += np.log(3900.0)
    few = Look(2, made.substeps(made.start, 1.0), True)
    needed = made.substeps(stiff, 1.0)
    assert needed > 2 * few.substeps
    assert made.evaluate(stiff, few) is not None
    assert made.evaluate(stiff, few)[0] == made.evaluate(stiff, replace(few, substeps=needed))[0]
    assert made.substeps(stiff, 2.0) == pytest.approx(2 * needed, abs=1)
