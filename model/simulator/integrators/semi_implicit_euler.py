"""Semi-implicit (symplectic) Euler."""

from model.simulator.dynamics import Dynamics
from model.simulator.integrators.base import Integrator
from model.simulator.system import Anchors, State


class SemiImplicitEuler(Integrator):
    r"""First the velocities, then the positions with the new velocities.

    $v \leftarrow (v + dt\,F/m)\,e^{-\delta\,dt}$, contacts, $x \leftarrow x + dt\,v$.
    Stable while $\lambda_{max}(dt^2 M^{-1}K + 2\,dt\,M^{-1}C) < 4$.

    Reference:
        Hairer, Lubich and Wanner (2003), Geometric numerical integration illustrated by the Störmer-Verlet
        method, Acta Numerica 12 (symplectic Euler).
    """

    name = "semi_implicit_euler"
    order = 1

    def step(self, dynamics: Dynamics, state: State, anchors: Anchors | None, dt: float) -> State:
        """The state [m, m/s] after `dt` [s]."""
        acceleration, memory = dynamics.acceleration(state, anchors, dt)
        velocities = dynamics.decay(state.velocities + dt * acceleration, dt)
        velocities = dynamics.collide(state.positions, velocities, dt)
        return State(state.positions + dt * velocities, velocities, memory)
