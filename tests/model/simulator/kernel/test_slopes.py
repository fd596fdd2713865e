"""The kernel's products with the Jacobian are those of autograd, and so is the bound that follows."""

import torch

from model.simulator.backend import choose_path
from model.simulator.system import Anchors, State


def test_products_are_those_of_autograd(scene, apart):
    made = scene()
    simulator = made.simulator
    generator = torch.Generator().manual_seed(0)
    vector = torch.randn(made.leaves["positions"].shape, generator=generator, dtype=torch.float64)
    hands = simulator.system.controller_points
    anchors = Anchors(hands, torch.randn(hands.shape, generator=generator, dtype=torch.float64))
    state = State(made.leaves["positions"].detach(), made.leaves["velocities"].detach())
    products = {}
    for backend in ("torch", "kernel"):
        path = choose_path(backend, simulator.dynamics(), simulator.integrator, torch.Size(()))
        slopes = path.slopes(state, anchors)
        slopes(torch.ones_like(vector))  # leaves nothing behind
        products[backend] = slopes(vector)
    for found, expected in zip(products["kernel"], products["torch"], strict=True):
        assert expected.norm() > 1.0
        assert apart(found, expected) < 1e-12


def test_the_bound_is_the_same_for_all_backends(scene):
    for batch in ((), (2,)):
        simulator = scene(batch=batch).simulator
        fine = 50.0  # seconds: so many substeps that a small difference of the bound shows
        found, expected = (simulator.with_backend(b).needed_substeps(fine) for b in ("kernel", "torch"))
        assert abs(found - expected) <= 1 + 1e-6 * expected
