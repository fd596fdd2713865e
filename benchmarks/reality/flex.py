"""The second MuJoCo generator: a continuum, MuJoCo's own finite elements (flex), where the other has springs.

What is elastic, and damps, are triangles and tetrahedra between the particles of `lattice.py`, of Saint
Venant's and Kirchhoff's law; hands, ground, surroundings and withheld effects are that generator's. Effects
along springs act along its springs, which are slack but for them. A rope is a chain in either.
"""

from dataclasses import replace

import mujoco
import numpy as np

from benchmarks.reality import lattice
from benchmarks.reality.nets import Lattice, cells
from benchmarks.reality.world import Array, Motion, World

STRETCH = 2
"""Of MuJoCo's flex in two dimensions: it resists being stretched; that it bends is a law of the lattice."""
TURNS = 80
"""Of the power iteration."""
STRETCHED = 3.0
"""How much stiffer Saint Venant's and Kirchhoff's law is half as long again."""


def simulate(world: World) -> Motion:
    """Move a world.

    Raises:
        Runaway: it left the finite numbers, or would need too many steps.
    """
    if world.shape.kind == "rope":
        return lattice.simulate(world)
    net = lattice.lattice(world.shape, world.spacing, world.mesh_seed)
    corners, measure = cells(net, world.shape.kind)
    share = np.bincount(corners.ravel(), np.repeat(measure, corners.shape[1]), len(net.nodes))
    whole = replace(net, share=share / corners.shape[1])
    return _Run(world, whole, corners).result()


class _Run(lattice.Run):
    """A run whose springs carry nothing but effects."""

    def __init__(self, world: World, net: Lattice, corners: Array) -> None:
        self.corners = corners
        super().__init__(world, net)
        # Effects and hands are as strong as springs would be: they have been made by now.
        for name in ("stiffness", "damping"):
            self.arrays[name] = np.zeros(len(net.springs))

    def elastic(self, spec: mujoco.MjSpec) -> None:
        """Add the elements of each half of the object; they share the particles between them."""
        dim, material = self.corners.shape[1] - 1, self.world.material
        thick = 2.0 * self.world.shape.radius if dim == 2 else 1.0
        middle = (self.net.nodes[self.corners].mean(axis=1) - self.world.shape.surface.mean(axis=0))[:, 0]
        halves = {
            "low": (material.stiffness[0], middle < 0.0),
            "high": (material.stiffness[1], middle >= 0.0),
        }
        for name, (young, part) in halves.items():
            used, corner = np.unique(self.corners[part], return_inverse=True)
            if len(used) == 0:
                continue
            flex = spec.add_flex()
            flex.name, flex.dim, flex.radius = name, dim, lattice.RADIUS
            flex.young, flex.poisson, flex.damping = young / thick, material.poisson, material.damping
            flex.contype = flex.conaffinity = flex.selfcollide = 0  # the particles are what collides
            if dim == 2:
                flex.thickness, flex.elastic2d = thick, STRETCH
            flex.vertbody = [f"p{node}" for node in used]
            flex.vert = [0.0] * (3 * len(used))
            flex.elem = corner.ravel().tolist()

    def frequency(self) -> float:
        """Highest frequency [1/s]: no less than of elements that are stretched, and springs beside them."""
        spec = mujoco.MjSpec()
        self.particles(spec, lattice.LONGEST)
        self.elastic(spec)
        model = spec.compile()
        model.dof_damping[:] = 0.0
        data = mujoco.MjData(model)
        root = np.sqrt(np.repeat(self.mass, 3))
        small = 1e-4 * self.world.spacing
        vector, largest = np.random.default_rng(0).normal(size=len(root)), 0.0
        for _ in range(TURNS):
            vector /= np.linalg.norm(vector)
            moved = vector / root
            scale = small / np.abs(moved).max()
            data.qpos[:] = scale * moved
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_passive(model, data)
            vector = -data.qfrc_passive / scale / root
            largest = float(np.linalg.norm(vector))
        return float(np.hypot(np.sqrt(STRETCHED * largest), super().frequency()))
