"""How large a substep may be."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import torch
from torch import Tensor

from model.simulator.dynamics import Dynamics
from model.simulator.system import Anchors, State

ITERATIONS = 200
TOLERANCE = 1e-4
FOLLOWING = 2
"""Iterations from a vector that is near."""
SHORT = 0.05
"""Edges shorter than this share of the usual length have no direction to speak of."""
SLOWEST = 1e-30
"""Norm below which nothing moves."""

Slopes: TypeAlias = Callable[[Tensor], tuple[Tensor, Tensor]]
"""(∂a/∂x)ᵀu and (∂a/∂v)ᵀu of a vector u, a being the accelerations of all points [m/s²]."""


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
    return StabilityWatch(dynamics, lambda s, a: differentiate(dynamics, s, a)).find(state, anchors)


class StabilityWatch:
    """The bound of `stable_step` along a rollout: found once, then followed at little cost.

    Explicit steps are themselves a power iteration: what grows in them is what lies outside of the bound. So
    the eigenvector of the last look, with what now moves added to it, is near the one sought, and a few
    iterations find its eigenvalue.

    Args:
        dynamics: The terms and their constants.
        slopes: How accelerations change near a state.
    """

    def __init__(self, dynamics: Dynamics, slopes: Callable[[State, Anchors | None], Slopes]) -> None:
        """See the class."""
        self._dynamics, self._slopes = dynamics, slopes
        self._root = dynamics.inverse_mass.detach().sqrt()
        self._vector: Tensor | None = None

    def find(self, state: State, anchors: Anchors | None) -> float:
        """The largest stable dt [s] near a state."""
        generator = torch.Generator().manual_seed(0)
        vector = torch.randn(state.positions.shape, generator=generator, dtype=torch.float64)
        vector = vector.to(state.positions)
        return self._iterate(self._stretched(state, anchors, vector), anchors, vector, ITERATIONS)

    @torch.no_grad()
    def _stretched(self, state: State, anchors: Anchors | None, vector: Tensor) -> State:
        """The state with no edge of nearly no length, which pulls one way or none, and soon pulls all ways.

        So lies a hand that holds a point where it is.
        """
        motion = self._dynamics.motion(state, anchors)
        if not len(motion.edges):
            return state
        length = motion.length.reshape(-1, motion.length.shape[-1]).amax(0)
        least = SHORT * float(length.median())
        touched = motion.edges.first[length < least]
        if not len(touched):
            return state
        moved = torch.zeros_like(state.positions)
        moved[..., touched, :] = least * vector[..., touched, :]
        return replace(state, positions=state.positions + moved)

    def follow(self, state: State, anchors: Anchors | None) -> float:
        """The same at a later state of the rollout."""
        moving = state.velocities.detach() / self._root
        if self._vector is None:
            return self.find(state, anchors)
        start = self._vector + moving / moving.norm().clamp_min(SLOWEST)
        return self._iterate(state, anchors, start, FOLLOWING)

    @torch.no_grad()
    def _iterate(self, state: State, anchors: Anchors | None, vector: Tensor, most: int) -> float:
        """The bound from a vector in the symmetric form M^-1/2 (K or C) M^-1/2; keeps where it came to.

        A spring much shorter than at rest is more unstable across than it is stiff along: where such a mode
        is the largest, all are lifted by as much, which leaves the modes and makes it the least.
        """
        slopes, step, lift = self._slopes(state, anchors), math.inf, 0.0
        vector = vector / vector.norm()
        for done in range(1, ITERATIONS + 1):
            # accelerations already hold one M^-1
            stiff, damped = (-slope * self._root for slope in slopes(vector / self._root))
            a, b = float((vector * stiff).sum()), float((vector * damped).sum())
            size = float(stiff.norm() + damped.norm())
            if size == 0.0 or not math.isfinite(size):
                return math.inf
            lift = max(lift, float(stiff.norm()) if a < 0.0 else 0.0)
            previous, step = step, _root(a, b)
            by = step if math.isfinite(step) else 1.0 / size
            turned = by**2 * (stiff + lift * vector) + 2 * by * damped
            vector = turned / turned.norm()
            if math.isfinite(step) and (done >= most or abs(previous - step) < TOLERANCE * step):
                break
        self._vector = vector
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
