"""Meshes of segments, triangles and tetrahedra for the finite-element generator."""

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay

from benchmarks.reality.shapes import Shape
from benchmarks.reality.world import Array


@dataclass(frozen=True)
class Mesh:
    """Nodes [n, 3] m, elements [e, dim+1], faces of the surface [f, 3], stencils of bending."""

    nodes: Array
    elements: Array
    faces: Array
    measure: Array
    """Length, area or volume of each element."""
    node_area: Array
    """Of the surface that belongs to a node [n] m²; a rope's is diameter times length."""
    stencil: Array
    """[s, 4] nodes whose weighted sum is a curvature."""
    stencil_weight: Array
    stencil_scale: Array
    """Energy is half of this times the bending stiffness times the square of that sum."""

    @property
    def dim(self) -> int:
        """1, 2 or 3."""
        return self.elements.shape[1] - 1


def mesh(shape: Shape, spacing: float, seed: int) -> Mesh:
    """Discretise a shape; the seed moves its inner nodes a little."""
    rng = np.random.default_rng(seed)
    return {"rope": _rope, "sheet": _sheet, "solid": _solid}[shape.kind](shape, spacing, rng)


def _rope(shape: Shape, spacing: float, rng: np.random.Generator) -> Mesh:
    # A finely sampled curve knows its own length.
    s = np.linspace(0, 2.0, 4001)
    length = s[shape.inside(s[:, None])].max()
    count = max(round(length / spacing), 8)
    place = np.linspace(0, length, count + 1)
    place[1:-1] += rng.uniform(-0.15, 0.15, count - 1) * length / count
    nodes = shape.curve(place)
    elements = np.stack([np.arange(count), np.arange(1, count + 1)], axis=1)
    size = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    area = np.zeros(count + 1)
    np.add.at(area, elements, np.repeat(size[:, None] * shape.radius, 2, axis=1))
    left, right = 1 / size[:-1], 1 / size[1:]
    inner = np.arange(1, count)
    stencil = np.stack([inner - 1, inner, inner + 1, inner], axis=1)
    weight = np.stack([left, -left - right, right, np.zeros(count - 1)], axis=1)
    return Mesh(
        nodes, elements, np.zeros((0, 3), int), size, area, stencil, weight, 2 / (size[:-1] + size[1:])
    )


def _sheet(shape: Shape, spacing: float, rng: np.random.Generator) -> Mesh:
    low, high = shape.box[:, :2]
    rows = int(np.ceil((high - low)[1] / (spacing * 0.866))) + 1
    columns = int(np.ceil((high - low)[0] / spacing)) + 1
    row, column = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    step = (high - low) / [columns - 0.5, rows - 1]
    flat = (low + np.stack([column + 0.5 * (row % 2), row], axis=-1) * step).reshape(-1, 2)
    edge = (column == 0) | (column == columns - 1) | (row == 0) | (row == rows - 1)
    moved = rng.uniform(-0.12, 0.12, flat.shape) * spacing * ~edge.reshape(-1, 1)
    flat = flat + moved
    flat = flat[shape.inside(np.column_stack([flat * (1 - 1e-9), np.zeros(len(flat))]))]
    triangles = Delaunay(flat).simplices
    corners = flat[triangles]
    inside = np.ones(len(triangles), bool)
    for mix in (
        (1, 1, 1),
        (2, 1, 0),
        (0, 2, 1),
        (1, 0, 2),
        (1, 1, 0),
        (0, 1, 1),
        (1, 0, 1),
        (5, 1, 0),
        (0, 1, 5),
        (5, 0, 1),
    ):
        w = np.array(mix) / sum(mix)
        inside &= shape.inside(
            np.column_stack([np.einsum("k,nkc->nc", w, corners) * (1 - 1e-6), np.zeros(len(triangles))])
        )
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    sides = sum(((corners[:, i] - corners[:, j]) ** 2).sum(axis=1) for i, j in ((0, 1), (1, 2), (2, 0)))
    keep = inside & (4 * np.sqrt(3) * np.abs(area) > 0.4 * sides)  # slivers would dictate the time step
    triangles, area = triangles[keep], area[keep]
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    nodes = np.column_stack([flat, shape.relief(flat)])
    nodes, triangles, kept = _largest(nodes, triangles)
    area = np.abs(area)[kept]
    node_area = np.zeros(len(nodes))
    np.add.at(node_area, triangles, np.repeat(area[:, None] / 3, 3, axis=1))
    stencil, weight, scale = _hinges(nodes, triangles)
    return Mesh(nodes, triangles, triangles, area, node_area, stencil, weight, scale)


def _hinges(nodes: Array, triangles: Array) -> tuple[Array, Array, Array]:
    """Stencils of the quadratic bending energy (Bergou et al. 2006) over inner edges."""
    owner: dict[tuple[int, int], list[int]] = {}
    for triangle in triangles:
        for k in range(3):
            i, j, opposite = triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3]
            owner.setdefault((min(i, j), max(i, j)), []).append(opposite)
    rows, weights, scales = [], [], []
    for (i, j), opposite in owner.items():
        if len(opposite) != 2:
            continue
        k, m = opposite
        edge = nodes[j] - nodes[i]
        cot = {}
        area = 0.0
        for o in (k, m):
            for start, way in ((i, edge), (j, -edge)):
                arm = nodes[o] - nodes[start]
                cross = np.linalg.norm(np.cross(way, arm))
                cot[o, start] = way @ arm / cross
            area += np.linalg.norm(np.cross(edge, nodes[k if o == k else m] - nodes[i])) / 2
        rows.append((i, j, k, m))
        weights.append(
            (cot[k, j] + cot[m, j], cot[k, i] + cot[m, i], -cot[k, i] - cot[k, j], -cot[m, i] - cot[m, j])
        )
        scales.append(3.0 / area)
    return np.array(rows).reshape(-1, 4), np.array(weights).reshape(-1, 4), np.array(scales)


def _solid(shape: Shape, spacing: float, rng: np.random.Generator) -> Mesh:
    low, high = shape.box
    count = np.maximum(np.round((high - low) / spacing).astype(int), 2)
    step = (high - low) / count
    cells = np.stack(np.meshgrid(*(np.arange(c) for c in count), indexing="ij"), axis=-1).reshape(-1, 3)
    probe = np.zeros(len(cells))
    offsets = np.stack(np.meshgrid(*[(0.2, 0.5, 0.8)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    for offset in offsets:
        probe += shape.inside(low + (cells + offset) * step)
    cells = cells[probe >= 0.45 * len(offsets)]
    # Six tetrahedra around the main diagonal of each cell (Kuhn).
    base = count + 1
    strides = np.array([base[1] * base[2], base[2], 1])
    tets = []
    for order in permutations(range(3)):
        path = np.zeros((4, 3), int)
        for k, axis in enumerate(order):
            path[k + 1] = path[k]
            path[k + 1, axis] = 1
        tets.append((cells[:, None] + path) @ strides)
    elements = np.concatenate(tets)
    used, elements = np.unique(elements, return_inverse=True)
    elements = elements.reshape(-1, 4)
    index = np.stack([used // strides[0], used // strides[1] % base[1], used % base[2]], axis=1)
    nodes = low + index * step
    nodes, elements, _ = _largest(nodes, elements)
    faces = _boundary(elements)
    free = np.setdiff1d(np.arange(len(nodes)), faces)
    nodes[free] += rng.uniform(-0.1, 0.1, (len(free), 3)) * step
    edges = nodes[elements[:, 1:]] - nodes[elements[:, :1]]
    volume = np.linalg.det(edges) / 6
    elements[volume < 0] = elements[volume < 0][:, [0, 1, 3, 2]]
    faces = _outward(nodes, elements, faces)
    area = (
        np.linalg.norm(
            np.cross(nodes[faces[:, 1]] - nodes[faces[:, 0]], nodes[faces[:, 2]] - nodes[faces[:, 0]]), axis=1
        )
        / 2
    )
    node_area = np.zeros(len(nodes))
    np.add.at(node_area, faces, np.repeat(area[:, None] / 3, 3, axis=1))
    none = np.zeros((0, 4), int)
    return Mesh(nodes, elements, faces, np.abs(volume), node_area, none, none.astype(float), np.zeros(0))


def _boundary(elements: Array) -> Array:
    sides = np.concatenate([elements[:, list(side)] for side in ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3))])
    _, first, count = np.unique(np.sort(sides, axis=1), axis=0, return_index=True, return_counts=True)
    return sides[first[count == 1]]


def _outward(nodes: Array, elements: Array, faces: Array) -> Array:
    """Turn the faces so that their normals leave the tetrahedron they belong to."""
    owner = {}
    for element in elements:
        for left_out in range(4):
            owner[tuple(sorted(np.delete(element, left_out)))] = element[left_out]
    faces = faces.copy()
    for row in faces:
        inner = nodes[owner[tuple(sorted(row))]]
        normal = np.cross(nodes[row[1]] - nodes[row[0]], nodes[row[2]] - nodes[row[0]])
        if normal @ (inner - nodes[row[0]]) > 0:
            row[[1, 2]] = row[[2, 1]]
    return faces


def _largest(nodes: Array, elements: Array) -> tuple[Array, Array, Array]:
    """Only the largest connected component: its nodes, its elements, and which elements those were."""
    pairs = np.concatenate([elements[:, [0, k]] for k in range(1, elements.shape[1])])
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (len(nodes), len(nodes)))
    _, label = connected_components(graph, directed=False)
    best = np.bincount(label[elements[:, 0]]).argmax()
    kept = label[elements[:, 0]] == best
    used, elements = np.unique(elements[kept], return_inverse=True)
    return nodes[used], elements.reshape(int(kept.sum()), -1), kept
