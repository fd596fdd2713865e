"""The same system in Newton's semi-implicit solver, which computes in float32."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from model.simulator.forces.gravity import Gravity

SHAPES = {"dumbbell": (2, 1, 1), "chain": (12, 1, 1), "sheet": (6, 6, 1), "block": (4, 4, 4)}
FPS, STEPS = 30.0, 60


@pytest.mark.parametrize("held", [True, False], ids=["handled", "free"])
@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_the_motion_is_newtons_to_its_digits(handled, peer, shape, held):
    """Both take the same step, so they part by the rounding of float32: as much as ours does in it.

    Twice that, since the two round in another order, and no less than one unit of the last place.
    """
    ours = {}
    for dtype in (torch.float64, torch.float32):
        body = handled(shape, held=held, dtype=dtype)
        simulator = body.simulator(Gravity())
        rollout = simulator.rollout(body.start, body.controls, frames=4, fps=FPS, substeps=STEPS)
        ours[dtype] = rollout.points.double().numpy()
    theirs = body.by(peer("peers_newton").NewtonSprings(simulator, 1 / FPS / STEPS), 4, 1 / FPS, STEPS)
    exact = ours[torch.float64]
    rounding = np.abs(ours[torch.float32] - exact).max() + np.finfo(np.float32).eps * np.abs(exact).max()
    assert np.abs(exact[-1] - exact[0]).max() > 0.02
    assert rounding < 1e-5
    assert np.abs(theirs - exact).max() < 2 * rounding


def test_the_gradient_is_newtons_to_its_digits(handled, peer):
    """Of the sum of all coordinates after a frame, to the stiffness of every spring, by Warp's tape."""
    ours = {}
    for dtype in (torch.float64, torch.float32):
        body = handled((4, 4, 4), held=False, dtype=dtype)
        stiffness = body.stiffness.clone().requires_grad_()
        simulator = replace(body, stiffness=stiffness).simulator(Gravity())
        end = simulator.rollout(body.start, frames=2, fps=FPS, substeps=STEPS).end.positions
        weights = torch.linspace(-1.0, 1.0, 3 * len(end), dtype=dtype).reshape(-1, 3)
        ours[dtype] = torch.autograd.grad((weights * end).sum(), stiffness)[0].numpy()
    springs = peer("peers_newton").NewtonSprings(simulator, 1 / FPS / STEPS, gradients=True)
    springs.set(body.start.positions.numpy(), body.start.velocities.numpy())
    graph = springs.replay(STEPS, weights.numpy())
    peer("warp").capture_launch(graph)
    theirs, exact = springs.model.spring_stiffness.grad.numpy(), ours[torch.float64]
    rounding = np.linalg.norm(ours[torch.float32] - exact)
    assert rounding < 1e-4 * np.linalg.norm(exact)
    assert np.linalg.norm(theirs - exact) < 2 * rounding
