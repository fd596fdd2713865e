"""How large a substep may be."""

import math

import torch

from model.simulator.dynamics import Dynamics
from model.simulator.system import Anchors, State

ITERATIONS = 200
TOLERANCE = 1e-4


def stable_step(dynamics: Dynamics, state: State, anchors: Anchors | None) -> float:
    r"""The largest stable dt [s] of semi-implicit Euler near `state`; infinite without stiffness and damping.

    The bound is $\lambda_{max}(dt^2 M^{-1}K + 2\,dt\,M^{-1}C) = 4$, with $K = -\partial F/\partial x$ and
    $C = -\partial F/\partial v$ of all force terms together, whatever they are, by reverse differentiation. A
    power iteration from a fixed vector finds the eigenvector, and dt follows from its two Rayleigh quotients.

    Args:
        dynamics: The terms and their constants.
        state: Where to linearise [m, m/s].
        anchors: Where the controllers are.

    Forces that overflow have no bound; the rollout then says which, and where.

    Reference:
        Hairer, Lubich and Wanner (2003), Geometric numerical integration illustrated by the Störmer-Verlet
        method, Acta Numerica 12 (dt·ω < 2 of the undamped oscillator); the damped bound is the root at -1 of
        the characteristic polynomial of v' = v - dt(ω²x + cv), x' = x + dt·v'.
    """
    positions = state.positions.detach().requires_grad_()
    velocities = state.velocities.detach().requires_grad_()
    with torch.enable_grad():
        acceleration, _ = dynamics.acceleration(State(positions, velocities, state.memory), anchors, 0.0)
    if not acceleration.requires_grad:
        return math.inf
    root = dynamics.inverse_mass.detach().sqrt()
    generator = torch.Generator().manual_seed(0)
    vector = torch.randn(positions.shape, generator=generator, dtype=torch.float64).to(positions)
    vector = vector / vector.norm()
    step = math.inf
    for _ in range(ITERATIONS):
        # symmetric form M^-1/2 (K or C) M^-1/2; `acceleration` already holds one M^-1
        gradients = torch.autograd.grad(
            acceleration, (positions, velocities), vector / root, retain_graph=True, allow_unused=True
        )
        stiff, damped = (torch.zeros_like(vector) if g is None else -g * root for g in gradients)
        a, b = float((vector * stiff).sum()), float((vector * damped).sum())
        previous, step = step, _root(a, b)
        if math.isinf(step):
            return step
        turned = step**2 * stiff + 2 * step * damped
        vector = turned / turned.norm()
        if abs(previous - step) < TOLERANCE * step:
            break
    return step


def _root(stiffness: float, damping: float) -> float:
    """The positive dt with dt²·stiffness + 2·dt·damping = 4; infinite where both vanish or are no numbers."""
    stiffness, damping = max(stiffness, 0.0), max(damping, 0.0)
    divisor = damping + math.sqrt(damping**2 + 4 * stiffness)
    return 4 / divisor if divisor > 0 else math.inf
