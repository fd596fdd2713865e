"""How large a substep may be."""

import math
from collections.abc import Callable
from typing import TypeAlias

import torch
from torch import Tensor

from model.simulator.dynamics import Dynamics
from model.simulator.system import Anchors, State

ITERATIONS = 200
TOLERANCE = 1e-4

Slopes: TypeAlias = Callable[[Tensor], tuple[Tensor, Tensor]]
"""(∂a/∂x)ᵀu and (∂a/∂v)ᵀu of a vector u, a being the accelerations of all points [m/s²]."""


def stable_step(
    dynamics: Dynamics, state: State, anchors: Anchors | None, slopes: Slopes | None = None
) -> float:
    r"""The largest stable dt [s] of semi-implicit Euler near `state`; infinite without stiffness and damping.

    The bound is $\lambda_{max}(dt^2 M^{-1}K + 2\,dt\,M^{-1}C) = 4$, with $K = -\partial F/\partial x$ and
    $C = -\partial F/\partial v$ of all force terms together, whatever they are, by reverse differentiation. A
    power iteration from a fixed vector finds the eigenvector, and dt follows from its two Rayleigh quotients.

    Args:
        dynamics: The terms and their constants.
        state: Where to linearise [m, m/s].
        anchors: Where the controllers are.
        slopes: How accelerations change there; None: by reverse differentiation.

    Forces that overflow have no bound; the rollout then says which, and where.

    Reference:
        Hairer, Lubich and Wanner (2003), Geometric numerical integration illustrated by the Störmer-Verlet
        method, Acta Numerica 12 (dt·ω < 2 of the undamped oscillator); the damped bound is the root at -1 of
        the characteristic polynomial of v' = v - dt(ω²x + cv), x' = x + dt·v'.
    """
    slopes = slopes or differentiate(dynamics, state, anchors)
    root = dynamics.inverse_mass.detach().sqrt()
    generator = torch.Generator().manual_seed(0)
    vector = torch.randn(state.positions.shape, generator=generator, dtype=torch.float64).to(state.positions)
    vector = vector / vector.norm()
    step = math.inf
    for _ in range(ITERATIONS):
        # symmetric form M^-1/2 (K or C) M^-1/2; accelerations already hold one M^-1
        stiff, damped = (-slope * root for slope in slopes(vector / root))
        a, b = float((vector * stiff).sum()), float((vector * damped).sum())
        previous, step = step, _root(a, b)
        if math.isinf(step):
            return step
        turned = step**2 * stiff + 2 * step * damped
        vector = turned / turned.norm()
        if abs(previous - step) < TOLERANCE * step:
            break
    return step


def differentiate(dynamics: Dynamics, state: State, anchors: Anchors | None) -> Slopes:
    """By reverse differentiation of all force terms near a state."""
    places = (state.positions.detach().requires_grad_(), state.velocities.detach().requires_grad_())
    with torch.enable_grad():
        acceleration, _ = dynamics.acceleration(State(*places, state.memory), anchors, 0.0)

    def slopes(vector: Tensor) -> tuple[Tensor, Tensor]:
        if not acceleration.requires_grad:
            return torch.zeros_like(vector), torch.zeros_like(vector)
        found = torch.autograd.grad(acceleration, places, vector, retain_graph=True, allow_unused=True)
        by_place, by_velocity = (torch.zeros_like(vector) if g is None else g for g in found)
        return by_place, by_velocity

    return slopes


def _root(stiffness: float, damping: float) -> float:
    """The positive dt with dt²·stiffness + 2·dt·damping = 4; infinite where both vanish or are no numbers."""
    stiffness, damping = max(stiffness, 0.0), max(damping, 0.0)
    divisor = damping + math.sqrt(damping**2 + 4 * stiffness)
    return 4 / divisor if divisor > 0 else math.inf
