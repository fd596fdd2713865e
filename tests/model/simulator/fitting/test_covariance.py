"""Spreads against a closed form: points that fall freely."""

import numpy as np
import pytest
import torch

from model.simulator.build import build_simulator
from model.simulator.fitting.fit import fit
from model.simulator.fitting.plan import Plan
from model.simulator.fitting.scene import Scene
from model.simulator.fitting.target import Target
from model.simulator.fitting.unknown import Gaussian, seek


@pytest.fixture
def falling():
    simulator = build_simulator(
        points=np.zeros((4, 3)),
        mass=np.ones(4),
        springs=np.zeros((0, 2)),
        rest_length=np.zeros(0),
        stiffness=1.0,
        dtype=torch.float64,
    )
    return Scene(simulator, np.arange(7) / 30.0)


def test_velocity_and_gravity_of_free_fall(falling):
    """x = v t + g t²/2: a straight line and a parabola, by linear least squares."""
    noise, times = 1e-3, falling.times
    points = falling.rollout().points
    rng = np.random.default_rng(0)
    target = Target(points + torch.from_numpy(rng.normal(0, noise, points.shape)), noise=noise)
    unknowns = [
        seek(falling, "state.velocities", start=torch.zeros(3), bounds=(-5.0, 5.0)),
        seek(falling, "gravity.gravity", start=torch.tensor([0.0, 0.0, -9.0]), bounds=(-20.0, 20.0)),
    ]
    found = fit(falling, unknowns, target, Plan(evaluations=60, horizons=(6,)), uncertain=True)
    design = np.stack([times, times**2 / 2], 1)
    expected = noise * np.sqrt(np.diag(np.linalg.inv(4 * design.T @ design)))
    scale = max(1.0, found.loss * 84 / 78) ** 0.5
    spread = found.covariance.spread
    assert spread["state.velocities"].tolist() == pytest.approx([scale * expected[0]] * 3, rel=0.02)
    assert spread["gravity.gravity"].tolist() == pytest.approx([scale * expected[1]] * 3, rel=0.02)
    assert found.covariance.correlation[0, 3] == pytest.approx(-0.96, abs=0.03)
    assert float(found.values["gravity.gravity"][2]) == pytest.approx(-9.81, abs=4 * expected[1])


def test_what_nothing_holds_has_the_spread_of_its_prior(falling):
    """Mass does not show in free fall."""
    target = Target(falling.rollout().points)
    mass = seek(falling, "system.mass", share=torch.zeros(4, dtype=torch.long), prior=Gaussian(1.0, 0.3))
    found = fit(falling, [mass], target, Plan(evaluations=6, horizons=(6,)), uncertain=True)
    assert float(found.covariance.spread["system.mass"]) == pytest.approx(0.3, rel=0.01)


@pytest.mark.parametrize("names", [["gravity.gravity", "system.mass"], ["system.mass"]])
def test_what_nothing_holds_may_be_anything(falling, names):
    """Not exactly what it was guessed to be; and what is held is no less so for it."""
    noise = 1e-3
    target = Target(falling.rollout().points, noise=noise)
    known = [
        seek(falling, "gravity.gravity", start=torch.tensor([0.0, 0.0, -9.81]), bounds=(-20.0, 20.0)),
        seek(falling, "system.mass", share=torch.zeros(4, dtype=torch.long)),
    ]
    unknowns = [each for each in known if each.name in names]
    found = fit(falling, unknowns, target, Plan(evaluations=6, horizons=(6,)), uncertain=True).covariance
    assert 100.0 < float(found.spread["system.mass"]) < float("inf")
    for name in names[:-1]:
        exact = noise / np.sqrt(4 * np.sum((falling.times**2 / 2) ** 2))
        assert found.spread[name].tolist() == pytest.approx([exact] * 3, rel=0.02)
    np.testing.assert_allclose(found.correlation, np.eye(len(found.names)), atol=1e-6)
