"""The rest shape of a topology as numbers that no shift, no turn about the vertical and no scale changes."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int
from scipy.spatial import cKDTree

from model.predictor.lattice import lattice_shares
from model.spring_graph import local_spacing
from model.types import Array, ShapeClass, Topology

EDGE_FEATURES = 16
PART_FEATURES = 9
SCENE_FEATURES = 12
GRIP_FEATURES = 4
"""Columns of the fields of `Geometry` below."""

AROUND = 13
"""Points of a neighbourhood, its middle included."""
_SHAPES: tuple[ShapeClass, ...] = ("sheet", "rope", "solid")
_FAR = 2.0
"""Distances over the size of the object are not told apart beyond."""


@dataclass(frozen=True)
class Geometry:
    """All that the network is told of the rest shape; it depends on no belief about materials."""

    edges: Float32[Array, "E Fe"]
    """Length, steepness, height, density and flatness of the surroundings, depth below the surface, …"""
    parts: Float32[Array, "K Fp"]
    """Share of the mass, elongation, height, how far it is held or lies on the ground, …"""
    scene: Float32[Array, " Fs"]
    grips: Float32[Array, "S Fg"]
    """Length of each controller spring, how many share its point, and where that point is."""
    shares: Float64[Array, "E 2"]
    """`lattice_shares`."""
    size: float
    """Diameter about the centre of mass [m]."""


@dataclass(frozen=True)
class _Surroundings:
    """Of every mass point."""

    spacing: Float64[Array, " P"]
    """Over the median."""
    offset: Float64[Array, " P"]
    """From the middle of its neighbours, over their radius: 0 inside, towards 1 at a surface or an end."""
    variance: Float64[Array, "P 3"]
    """Shares along the principal axes, smallest first."""
    axis: Float64[Array, "P 3"]
    """In which the body runs."""
    degree: Float64[Array, " P"]
    """Springs, over the mean of the part."""
    held: Float64[Array, " P"]
    """Distance to the nearest held point over the size of the object."""


def describe_geometry(
    topology: Topology, parts: int, shape_class: ShapeClass, ground_height: float | None
) -> Geometry:
    """Measure a rest shape.

    Args:
        topology: At rest.
        parts: K, at least what the labels need.
        shape_class: Sheet, rope or solid.
        ground_height: z of the ground [m]; None: no ground.
    """
    points = topology.points.astype(np.float64)
    mass = topology.mass.astype(np.float64)
    size = 2.0 * float(np.linalg.norm(points - np.average(points, 0, mass), axis=1).max())
    around = _surroundings(topology, size)
    shares = lattice_shares(topology, parts, shape_class)
    return Geometry(
        edges=_edges(topology, around, shares, size),
        parts=_parts(topology, parts, size, ground_height),
        scene=_scene(topology, shape_class, size, ground_height),
        grips=_grips(topology, around),
        shares=shares,
        size=size,
    )


def _surroundings(topology: Topology, size: float) -> _Surroundings:
    points = topology.points.astype(np.float64)
    count = min(AROUND, len(points))
    tree = cKDTree(points)
    near = points[tree.query(points, count)[1].reshape(len(points), count)]
    offset = near - near.mean(axis=1, keepdims=True)
    variance, axes = np.linalg.eigh(np.einsum("pki,pkj->pij", offset, offset))
    radius = np.sqrt(np.maximum(variance.sum(axis=1), 1e-24) / count)
    held = np.unique(topology.controller_springs[:, 1])
    distance = cKDTree(points[held]).query(points)[0] if len(held) else np.full(len(points), np.inf)
    spacing = local_spacing(points)
    degree = np.bincount(topology.springs.ravel(), minlength=len(points)).astype(np.float64)
    return _Surroundings(
        spacing=spacing / np.median(spacing),
        offset=np.linalg.norm(points - near.mean(axis=1), axis=1) / radius,
        variance=variance / np.maximum(variance.sum(axis=1, keepdims=True), 1e-24),
        axis=axes[:, :, -1],
        degree=degree / _part_mean(topology.part, degree)[topology.part],
        held=np.minimum(distance / size, _FAR),
    )


def _edges(
    topology: Topology, around: _Surroundings, shares: Float64[Array, "E 2"], size: float
) -> Float32[Array, "E Fe"]:
    """Symmetric in the two ends: each column is of the spring, or the mean or the difference of its ends.

    How many springs a part has, and how long, was chosen by what its material was thought to be when the
    topology was built. That is no news, and must not be read as such where the belief has changed since: so
    springs are compared with those of their own part.
    """
    points, ends = topology.points.astype(np.float64), topology.springs
    length = topology.rest_length.astype(np.float64)
    offset = points[ends[:, 1]] - points[ends[:, 0]]
    direction = offset / np.maximum(np.linalg.norm(offset, axis=1, keepdims=True), 1e-12)
    mass = np.log(topology.mass.astype(np.float64))
    unit = np.log(np.maximum(shares.sum(axis=1), 1e-300))
    both = topology.part[ends]

    def against(values: Float64[Array, " E"]) -> Float64[Array, " E"]:
        usual = _part_mean(both.ravel(), np.repeat(values, 2))
        return np.asarray(np.clip(values - usual[both].mean(axis=1), -_FAR, _FAR), np.float64)

    height = points[:, 2] - points[:, 2].min()

    def mean(values: Float64[Array, " P"]) -> Float64[Array, " E"]:
        return np.asarray(values[ends].mean(axis=1), np.float64)

    def apart(values: Float64[Array, " P"]) -> Float64[Array, " E"]:
        return np.asarray(np.abs(values[ends[:, 0]] - values[ends[:, 1]]), np.float64)

    along = np.stack([np.einsum("ei,ei->e", direction, around.axis[ends[:, side]]) for side in (0, 1)], 1)
    columns = [
        against(np.log(length)),
        np.abs(direction[:, 2]),
        (along**2).mean(axis=1),
        mean(height) / size,
        mean(around.degree),
        apart(around.degree),
        mean(np.log(around.spacing)),
        apart(np.log(around.spacing)),
        mean(around.offset),
        apart(around.offset),
        mean(around.variance[:, 0]),
        mean(around.variance[:, 2]),
        mean(around.held),
        mean(mass - _part_mean(topology.part, mass)[topology.part]),
        (topology.part[ends[:, 0]] != topology.part[ends[:, 1]]).astype(np.float64),
        against(unit),
    ]
    return np.stack(columns, axis=1).astype(np.float32)


def _parts(
    topology: Topology, parts: int, size: float, ground_height: float | None
) -> Float32[Array, "K Fp"]:
    rows = np.zeros((parts, PART_FEATURES), np.float32)
    held = np.isin(np.arange(len(topology.points)), topology.controller_springs[:, 1])
    ends = topology.part[topology.springs]
    spacing = float(np.median(local_spacing(topology.points.astype(np.float64))))
    for part in range(parts):
        own = topology.part == part
        if not own.any():  # a label nobody has: a part without mass, known by its zeros
            continue
        points = topology.points[own].astype(np.float64)
        touching = (ends == part).any(axis=1)
        rows[part] = (
            np.log(topology.mass[own].sum() / topology.mass.sum()),
            np.log(own.sum() / 100.0) / 2.0,
            *_elongation(points),
            np.log(max(2.0 * float(np.sqrt(points.var(axis=0).sum())), spacing) / size),
            (points[:, 2].mean() - topology.points[:, 2].min()) / size,
            held[own].mean(),
            0.0 if ground_height is None else (points[:, 2] < ground_height + spacing).mean(),
            (ends[touching, 0] != ends[touching, 1]).mean() if touching.any() else 0.0,
        )
    return rows


def _elongation(points: Float64[Array, "n 3"]) -> tuple[float, float]:
    """Second and third principal extent over the first."""
    offset = points - points.mean(axis=0)
    variance = np.maximum(np.linalg.eigvalsh(offset.T @ offset), 0.0)
    if variance[2] <= 0.0:
        return 1.0, 1.0
    return float(np.sqrt(variance[1] / variance[2])), float(np.sqrt(variance[0] / variance[2]))


def _part_mean(part: Int[Array, " n"], values: Float64[Array, " n"]) -> Float64[Array, " K"]:
    """Mean per label; 1 for a label of nobody."""
    count = np.bincount(part)
    return np.where(count > 0, np.bincount(part, values) / np.maximum(count, 1), 1.0)


def _scene(
    topology: Topology, shape_class: ShapeClass, size: float, ground_height: float | None
) -> Float32[Array, " Fs"]:
    points, mass = topology.points.astype(np.float64), topology.mass.astype(np.float64)
    lowest, controllers = float(points[:, 2].min()), len(topology.controller_points)
    spacing = float(np.median(local_spacing(points)))
    values = (
        np.log(size / 0.3),
        np.log(spacing / size) + 2.5,
        np.log(mass.sum() / 0.2) / 2.0,
        np.log(len(points) / 500.0),
        *(float(shape_class == shape) for shape in _SHAPES),
        float(controllers > 0),
        len(np.unique(topology.controller_springs[:, 1])) / len(points),
        float(ground_height is not None),
        0.0 if ground_height is None else min((lowest - ground_height) / size, _FAR),
        (float(np.average(points[:, 2], weights=mass)) - lowest) / size,
    )
    return np.array(values, np.float32)


def _grips(topology: Topology, around: _Surroundings) -> Float32[Array, "S Fg"]:
    held: Int[Array, " S"] = topology.controller_springs[:, 1]
    sharing = np.bincount(held, minlength=len(topology.points))[held]
    length = topology.controller_rest_length.astype(np.float64) / np.median(topology.rest_length)
    columns = [
        np.log(np.maximum(length, 1e-3)),
        sharing / 5.0,
        around.offset[held],
        around.degree[held] / 20.0,
    ]
    return np.stack(columns, axis=1).astype(np.float32)
