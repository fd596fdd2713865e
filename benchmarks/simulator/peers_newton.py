"""A simulator's springs in Newton's semi-implicit solver, in float32 on the CPU.

For the comparison in kernel.py, and for the tests of parity. Newton's particles have no drag and no
restitution, so neither is in it, nor is the ground; gravity, springs and their dashpots are, by the same law
and the same semi-implicit Euler step. A controller is a particle that the solver does not move: its place and
velocity are written before each step.
"""

from itertools import pairwise

import newton
import numpy as np
import warp as wp
from springs import springs

from model.simulator.simulator import Simulator
from model.simulator.system import Anchors


class NewtonSprings:
    """The system of a simulator, stepped by Newton.

    Args:
        simulator: Linear springs, one dashpot, gravity.
        dt: Substep [s].
        gradients: Keep what a gradient needs; for `replay`.
    """

    def __init__(self, simulator: Simulator, dt: float, gradients: bool = False) -> None:
        """See the class."""
        system = simulator.system
        self.count, self.held, self.dt = len(system.points), system.controller_count, dt
        self.model = _model(simulator, gradients)
        self.solver = newton.solvers.SolverSemiImplicit(self.model)
        self.now, self._next = self.model.state(), self.model.state()
        self.hands = np.zeros((0, 3)) if not self.held else system.controller_points.numpy()

    def set(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """Points at `positions` [m] with `velocities` [m/s], [N, 3]."""
        self.now.particle_q.numpy()[: self.count] = positions
        self.now.particle_qd.numpy()[: self.count] = velocities

    def step(self, anchors: Anchors | None = None) -> None:
        """One substep, with the controllers at `anchors`; None: where they rest."""
        if self.held:
            self.now.particle_q.numpy()[self.count :] = self.hands if anchors is None else anchors.positions
            self.now.particle_qd.numpy()[self.count :] = 0.0 if anchors is None else anchors.velocities
        self.now.clear_forces()
        self.solver.step(self.now, self._next, None, None, self.dt)
        self.now, self._next = self._next, self.now

    @property
    def positions(self) -> np.ndarray:
        """[m], [N, 3]."""
        return self.now.particle_q.numpy()[: self.count].copy()

    @property
    def velocities(self) -> np.ndarray:
        """[m/s], [N, 3]."""
        return self.now.particle_qd.numpy()[: self.count].copy()

    def replay(self, steps: int, weights: np.ndarray | None = None) -> wp.Graph:
        """Substeps from the state now, captured to be launched without Python.

        With `weights`: and the gradient of the weighted sum of all final coordinates [N, 3] to the
        stiffness of every spring, by Warp's tape; it is left in `model.spring_stiffness.grad`.
        """
        states = [self.now, *(self.model.state() for _ in range(steps))]

        def substeps() -> None:
            for before, after in pairwise(states):
                before.clear_forces()
                self.solver.step(before, after, None, None, self.dt)

        substeps()  # compiles what is not yet
        with wp.ScopedCapture(device="cpu") as capture:
            if weights is not None:
                padded = np.zeros((self.count + self.held, 3), np.float32)
                padded[: self.count] = weights
                seed = wp.array(padded, dtype=wp.vec3, device="cpu")
                tape = wp.Tape()
                with tape:
                    substeps()
                tape.zero()
                tape.backward(grads={states[-1].particle_q: seed})
            else:
                substeps()
        return capture.graph


def _model(simulator: Simulator, gradients: bool) -> newton.Model:
    """Particles and springs, those of the controllers last."""
    system, edges = simulator.system, simulator.system.edges
    builder = newton.ModelBuilder()
    places = system.points.tolist()
    hands = system.controller_points.tolist() if system.controller_count else []
    mass = system.value("mass").expand(len(places)).tolist()
    builder.add_particles(
        pos=[wp.vec3(*place) for place in [*places, *hands]],
        vel=[wp.vec3(0.0, 0.0, 0.0)] * (len(places) + len(hands)),
        mass=mass + [1.0] * len(hands),
        flags=[int(newton.ParticleFlags.ACTIVE)] * len(places) + [0] * len(hands),
    )
    stiffness, lengths, damping = springs(simulator)
    for i, j, k in zip(edges.first.tolist(), edges.second.tolist(), stiffness, strict=True):
        builder.add_spring(i, j, k, damping, control=0.0)
    builder.spring_rest_length = lengths
    model = builder.finalize(device="cpu", requires_grad=gradients)
    falls = "gravity" in simulator.forces
    model.set_gravity(simulator.force("gravity").value("gravity").tolist() if falls else [0.0] * 3)
    model.particle_grid = None  # particles do not meet each other
    return model
