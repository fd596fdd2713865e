"""Lattices of particles and springs for the MuJoCo generators, and the cells between the particles."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from benchmarks.reality.shapes import Shape
from benchmarks.reality.world import Array, Kind

FLAT = 0.1
"""Least measure of a cell over that of a regular one with its longest edge: slivers dictate the time step."""


@dataclass(frozen=True)
class Lattice:
    """Nodes [n, 3] m, springs [e, 2], their stiffness per Young's modulus [e], triplets that bend [b, 3]."""

    nodes: Array
    springs: Array
    unit: Array
    share: Array
    """Of the measure of the object, per node."""
    area: Array
    triplets: Array


def lattice(shape: Shape, spacing: float, seed: int) -> Lattice:
    """A chain, a square net with diagonals turned against the cloth, or a body-centred lattice."""
    rng = np.random.default_rng(seed)
    return {"rope": _chain, "sheet": _net, "solid": _centred}[shape.kind](shape, spacing, rng)


def _chain(shape: Shape, spacing: float, rng: np.random.Generator) -> Lattice:
    s = np.linspace(0, 2.0, 4001)
    length = s[shape.inside(s[:, None])].max()
    count = max(round(length / spacing), 8)
    nodes = shape.curve(np.linspace(0, length, count + 1))
    index = np.arange(count + 1)
    springs = np.stack([index[:-1], index[1:]], axis=1)
    share = np.full(count + 1, length / count)
    share[[0, -1]] /= 2
    triplets = np.stack([index[:-2], index[1:-1], index[2:]], axis=1)
    return Lattice(nodes, springs, np.full(count, count / length), share, share * 2 * shape.radius, triplets)


def _net(shape: Shape, spacing: float, rng: np.random.Generator) -> Lattice:
    low, high = shape.box[:, :2]
    count = np.maximum(np.round((high - low) / spacing).astype(int), 4)
    step = (high - low) / count
    grid = np.stack(
        np.meshgrid(np.arange(count[0] + 1), np.arange(count[1] + 1), indexing="ij"), axis=-1
    ).reshape(-1, 2)
    flat = low + grid * step
    kept = shape.inside(np.column_stack([flat * (1 - 1e-9), np.zeros(len(flat))]))
    grid, flat = grid[kept], flat[kept]
    nodes = np.column_stack([flat, shape.relief(flat)])
    index = {tuple(cell): k for k, cell in enumerate(grid)}
    springs, unit, triplets = [], [], []
    for cell, k in index.items():
        for way, strength in (((1, 0), 0.75), ((0, 1), 0.75), ((1, 1), 0.375), ((1, -1), 0.375)):
            other = index.get((cell[0] + way[0], cell[1] + way[1]))
            before = index.get((cell[0] - way[0], cell[1] - way[1]))
            if other is not None:
                springs.append((k, other))
                unit.append(strength)
                if before is not None and 0 in way:
                    triplets.append((before, k, other))
    share = np.full(len(nodes), step.prod())
    return Lattice(nodes, np.array(springs), np.array(unit), share, share, np.array(triplets))


def _centred(shape: Shape, spacing: float, rng: np.random.Generator) -> Lattice:
    side = spacing * 1.25
    low, high = shape.box
    count = np.maximum(np.round((high - low) / side).astype(int), 2)
    step = (high - low) / count
    corners = np.stack(np.meshgrid(*(np.arange(c + 1) for c in count), indexing="ij"), axis=-1).reshape(-1, 3)
    centres = (
        np.stack(np.meshgrid(*(np.arange(c) for c in count), indexing="ij"), axis=-1).reshape(-1, 3) + 0.5
    )
    grid = np.concatenate([corners, centres])
    middle = (low + high) / 2
    nodes = low + grid * step
    nodes = nodes[shape.inside(middle + (nodes - middle) * (1 - 1e-6))]
    pairs = cKDTree(nodes / step).query_pairs(1.05, output_type="ndarray")
    length = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
    degree = np.bincount(pairs.ravel(), minlength=len(nodes))
    used = np.flatnonzero(degree >= 3)
    renumber = np.full(len(nodes), -1)
    renumber[used] = np.arange(len(used))
    kept = (renumber[pairs] >= 0).all(axis=1)
    springs, nodes, degree = renumber[pairs[kept]], nodes[used], degree[used]
    unit = 0.45 * side**2 / length[kept]
    share = np.where(degree < 10, 0.6, 1.0) * step.prod() / 2
    area = np.where(degree < 10, side**2 / 1.5, 0.0)
    return Lattice(nodes, springs, unit, share, area, np.zeros((0, 3), int))


def cells(lattice: Lattice, kind: Kind) -> tuple[Array, Array]:
    """Triangles [c, 3] of a sheet or tetrahedra [c, 4] of a solid between the nodes, and their measures [c].

    Those are left out that have an edge longer than the diagonal of a square, as across a notch, and slivers.
    """
    nodes = lattice.nodes
    corners = Delaunay(nodes[:, :2] if kind == "sheet" else nodes).simplices
    edges = nodes[corners[:, 1:]] - nodes[corners[:, :1]]
    if kind == "sheet":
        measure, regular, diagonal = np.linalg.det(edges[:, :, :2]) / 2, np.sqrt(3) / 4, 1.0
    else:
        measure, regular, diagonal = np.linalg.det(edges) / 6, np.sqrt(2) / 12, np.sqrt(2)
    springs = np.linalg.norm(nodes[lattice.springs[:, 1]] - nodes[lattice.springs[:, 0]], axis=1)
    longest = np.linalg.norm(nodes[corners[:, :, None]] - nodes[corners[:, None]], axis=3).max(axis=(1, 2))
    thick = np.abs(measure) > FLAT * regular * longest ** edges.shape[1]
    kept = thick & (longest < 1.01 * diagonal * springs.max())
    corners, measure = corners[kept], measure[kept]
    turned = measure < 0
    corners[turned] = corners[turned][:, [1, 0, *range(2, corners.shape[1])]]
    return corners, np.abs(measure)
