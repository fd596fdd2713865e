"""A spring solver in NVIDIA Warp, the way the field writes it: one thread per edge, atomics, a tape, a graph.

Written for the comparison in kernel.py, after the description of PhysTwin's solver: force of springs and
dashpots per edge with atomic adds, then a kernel per point for gravity, drag, the ground and the integration;
one array of positions, velocities and forces per substep, because the tape needs them all. The launches, and
those of the tape, are captured in a graph and replayed, so no Python runs in what is timed.
"""

import numpy as np
import warp as wp

from model.simulator.simulator import Simulator

wp.config.log_level = wp.LOG_WARNING
wp.init()


@wp.kernel
def pull_edges(
    x: wp.array(dtype=wp.vec3),
    v: wp.array(dtype=wp.vec3),
    hands: wp.array(dtype=wp.vec3),
    points: int,
    ends: wp.array(dtype=wp.vec2i),
    rest_length: wp.array(dtype=float),
    stiffness: wp.array(dtype=float),
    damping: float,
    force: wp.array(dtype=wp.vec3),
):
    """Springs and dashpots, one thread per edge."""
    edge = wp.tid()
    i = ends[edge][0]
    j = ends[edge][1]
    other = wp.vec3(0.0, 0.0, 0.0)
    moving = wp.vec3(0.0, 0.0, 0.0)
    if j < points:
        other = x[j]
        moving = v[j]
    else:
        other = hands[j - points]
    d = other - x[i]
    length = wp.max(wp.length(d), 1.0e-6)
    n = d / length
    tension = stiffness[edge] * (length - rest_length[edge]) + damping * wp.dot(moving - v[i], n)
    pulled = tension * n
    wp.atomic_add(force, i, pulled)
    if j < points:
        wp.atomic_sub(force, j, pulled)


@wp.kernel
def move_points(
    x: wp.array(dtype=wp.vec3),
    v: wp.array(dtype=wp.vec3),
    force: wp.array(dtype=wp.vec3),
    mass: wp.array(dtype=float),
    drag_rate: float,
    friction: float,
    restitution: float,
    dt: float,
    x_after: wp.array(dtype=wp.vec3),
    v_after: wp.array(dtype=wp.vec3),
):
    """Gravity, drag, the ground and the integration, one thread per point."""
    i = wp.tid()
    w = (v[i] + dt * (force[i] / mass[i] + wp.vec3(0.0, 0.0, -9.81))) * wp.exp(-drag_rate * dt)
    if x[i][2] + dt * w[2] < 0.0 and w[2] < 0.0:
        slip = wp.max(wp.sqrt(w[0] * w[0] + w[1] * w[1]), 1.0e-6)
        kept = wp.max(0.0, 1.0 + friction * (1.0 + restitution) * w[2] / slip)
        w = wp.vec3(w[0] * kept, w[1] * kept, -restitution * w[2])
    v_after[i] = w
    x_after[i] = x[i] + dt * w


class WarpSprings:
    """A number of substeps of a simulator's system, forward or with the gradient to every stiffness."""

    def __init__(
        self, simulator: Simulator, dt: float, steps: int, gradients: bool, device: str = "cpu"
    ) -> None:
        """Allocate, and capture the graph."""
        system, edges = simulator.system, simulator.system.edges
        count = len(system.points)

        def number(value) -> np.ndarray:
            return value.detach().numpy().astype(np.float32)

        def vectors(given=None) -> wp.array:
            data = np.zeros((count, 3), np.float32) if given is None else number(given)
            return wp.array(data, dtype=wp.vec3, device=device, requires_grad=gradients)

        lengths = np.concatenate([number(system.value(n)) for n in ("rest_length", "controller_rest_length")])
        stiff = np.concatenate(
            [number(simulator.force(n).value("stiffness")) for n in ("spring", "controller_spring")]
        )
        ends = np.stack([edges.first.numpy(), edges.second.numpy()], 1).astype(np.int32)
        self.stiffness = wp.array(stiff, dtype=float, device=device, requires_grad=gradients)
        self.x = [vectors(system.points), *(vectors() for _ in range(steps))]
        self.v = [vectors() for _ in range(steps + 1)]
        force = [vectors() for _ in range(steps)]
        hands = wp.array(number(system.controller_points), dtype=wp.vec3, device=device)
        mass = wp.array(np.broadcast_to(number(system.value("mass")), count), dtype=float, device=device)
        fixed = [
            wp.array(ends, dtype=wp.vec2i, device=device),
            wp.array(lengths, dtype=float, device=device),
            self.stiffness,
            float(simulator.force("dashpot").value("dashpot_damping")),
        ]
        ground = simulator.contact("ground")
        rates = [float(simulator.force("drag").value("drag_rate"))]
        rates += [float(ground.value(name)) for name in ("friction", "restitution")]

        def substeps() -> None:
            for s in range(steps):
                given = [self.x[s], self.v[s], hands, count, *fixed]
                wp.launch(pull_edges, dim=len(ends), inputs=given, outputs=[force[s]], device=device)
                given = [self.x[s], self.v[s], force[s], mass, *rates, dt]
                after = [self.x[s + 1], self.v[s + 1]]
                wp.launch(move_points, dim=count, inputs=given, outputs=after, device=device)

        seed = wp.array(np.ones((count, 3), np.float32), dtype=wp.vec3, device=device)
        wp.load_module(device=device)
        states = [*self.x, *self.v, *force]
        with wp.ScopedCapture(device=device) as capture:
            for f in force:
                f.zero_()
            if gradients:
                for array in [*states, self.stiffness]:
                    array.grad.zero_()
                tape = wp.Tape()
                with tape:
                    substeps()
                tape.backward(grads={self.x[-1]: seed})
            else:
                substeps()
        self._graph = capture.graph

    def run(self) -> None:
        """Replay."""
        wp.capture_launch(self._graph)
