"""The kernel's products with the Jacobian are those of autograd, and so is the bound that follows."""

import numpy as np
import pytest
import torch

from model.gap.effects.viscoelasticity import MaxwellBranch
from model.simulator.backend import choose_path
from model.simulator.system import Anchors, State


def branch():
    """A law that remembers."""
    rng = np.random.default_rng(3)
    stiffness, share = torch.tensor(rng.uniform(20.0, 60.0, 260)), torch.tensor(rng.uniform(0.0, 1.0, 260))
    return MaxwellBranch(stiffness, share, torch.tensor(2.0), torch.tensor(0.05))


@pytest.mark.parametrize("remembers", [False, True])
def test_products_are_those_of_autograd(scene, apart, remembers):
    made = scene(forces=[branch()] if remembers else [])
    simulator = made.simulator
    generator = torch.Generator().manual_seed(0)
    vector = torch.randn(made.leaves["positions"].shape, generator=generator, dtype=torch.float64)
    hands = simulator.system.controller_points
    anchors = Anchors(hands, torch.randn(hands.shape, generator=generator, dtype=torch.float64))
    memory = {
        "viscoelasticity.viscous_strain": 0.1 * torch.rand(260, generator=generator, dtype=torch.float64)
    }
    places = made.leaves["positions"].detach(), made.leaves["velocities"].detach()
    state = State(*places, memory if remembers else {})
    products = {}
    for backend in ("torch", "kernel"):
        path = choose_path(backend, simulator.dynamics(), simulator.integrator, torch.Size(()))
        slopes = path.slopes(state, anchors)
        slopes(torch.ones_like(vector))  # leaves nothing behind
        products[backend] = slopes(vector)
    for found, expected in zip(products["kernel"], products["torch"], strict=True):
        assert expected.norm() > 1.0
        assert apart(found, expected) < 1e-12


@pytest.mark.parametrize("remembers", [False, True])
def test_the_bound_is_the_same_for_all_backends(scene, remembers):
    for batch in ((), (2,)):
        simulator = scene(forces=[branch()] if remembers else [], batch=batch).simulator
        fine = 50.0  # seconds: so many substeps that a small difference of the bound shows
        found, expected = (simulator.with_backend(b).needed_substeps(fine) for b in ("kernel", "torch"))
        assert abs(found - expected) <= 1 + 1e-6 * expected
