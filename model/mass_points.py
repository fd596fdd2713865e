"""Where the mass points of a body lie, and what each weighs."""

import numpy as np
from jaxtyping import Float, Float32, Float64, Int
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from model.types import Array, Gaussians, ShapeClass

ROPE_SPACING = 0.6
"""Spacing of a rope's points over its radius: a dozen points per section, so that it resists bending."""
LIGHTEST = 0.35
"""The lightest point weighs at least this much of the median one: light points on stiff springs would
set the time step of the whole."""


def place_points(
    gaussians: Gaussians, shape_class: ShapeClass, count: int, seed: int
) -> tuple[Float64[Array, "N 3"], Int[Array, " N"]]:
    """Spread mass points evenly through the volume; each sits on (of a sheet: below) a Gaussian.

    Farthest-point sampling, so inside and surface are both covered whatever the density of the Gaussians.
    A rope gets no more points than make a dozen per section, a sheet one layer on its middle surface.

    Returns:
        Distinct positions [m], at most `count`, and the Gaussian of each.

    Reference:
        Gonzalez (1985), Clustering to minimize the maximum intercluster distance.
    """
    means = gaussians.means.astype(np.float64)
    closest = 1e-4 * float(np.linalg.norm(np.ptp(means, axis=0)))
    if shape_class == "rope":
        volume = float(gaussians.volumes.sum())
        radius = np.sqrt(volume / (np.pi * max(length_along(means), 1e-9)))
        closest = max(closest, ROPE_SPACING * radius)
    chosen = _farthest(means, count, closest, seed)
    if shape_class != "sheet" or len(chosen) < 3:
        return means[chosen], chosen
    spacing = float(np.median(cKDTree(means[chosen]).query(means[chosen], 2)[0][:, 1]))
    points = _flatten(means[chosen], gaussians, 2.0 * spacing)
    layer = _farthest(points, count, 0.5 * spacing, seed)
    return points[layer], chosen[layer]


def _flatten(points: Float64[Array, "N 3"], gaussians: Gaussians, radius: float) -> Float64[Array, "N 3"]:
    """Move points onto the middle surface of a sheet: the local plane of the Gaussians around them."""
    moved = points.copy()
    for index, near in enumerate(cKDTree(gaussians.means).query_ball_point(points, radius)):
        if len(near) < 6:
            continue
        weights = gaussians.volumes[near].astype(np.float64)
        around = gaussians.means[near].astype(np.float64)
        centre = weights @ around / weights.sum()
        spread = (around - centre).T @ ((around - centre) * weights[:, None])
        normal = np.linalg.eigh(spread)[1][:, 0]
        moved[index] -= ((points[index] - centre) @ normal) * normal
    return moved


def share_mass(
    points: Float64[Array, "N 3"], gaussians: Gaussians, density: Float[Array, " G"]
) -> Float32[Array, " N"]:
    """Mass of each point [kg]: density × volume of the Gaussians nearest to it, none too light.

    Points below `LIGHTEST` of the median are raised to it and the others pay for it, so that the total
    is the object's.
    """
    owner = cKDTree(points).query(gaussians.means)[1]
    mass = np.bincount(owner, density.astype(np.float64) * gaussians.volumes, minlength=len(points))
    total = mass.sum()
    mass = np.maximum(mass, LIGHTEST * np.median(mass[mass > 0]))
    return np.asarray(mass * (total / mass.sum()), np.float32)


def length_along(means: Float[Array, "G 3"]) -> float:
    """Length of an elongated body [m]: the longest of shortest paths through its Gaussians."""
    sample = means[_farthest(np.asarray(means, np.float64), 400, 0.0, 0)]
    neighbours = min(9, len(sample))
    distance, index = cKDTree(sample).query(sample, neighbours)
    rows = np.repeat(np.arange(len(sample)), neighbours)
    graph = csr_matrix((distance.ravel(), (rows, index.ravel())), shape=(len(sample),) * 2)
    length = 0.0
    start = 0
    for _ in range(2):
        reach = dijkstra(graph, directed=False, indices=start)
        reach[~np.isfinite(reach)] = 0.0
        start, length = int(np.argmax(reach)), float(reach.max())
    return length


def _farthest(points: Float64[Array, "G 3"], count: int, closest: float, seed: int) -> Int[Array, " N"]:
    """Indices by farthest-point sampling, until `count` or until all lie within `closest` [m]."""
    chosen = [int(np.random.default_rng(seed).integers(len(points)))]
    distance = ((points - points[chosen[0]]) ** 2).sum(axis=1)
    while len(chosen) < min(count, len(points)):
        farthest = int(np.argmax(distance))
        if distance[farthest] <= closest**2:
            break
        chosen.append(farthest)
        distance = np.minimum(distance, ((points - points[farthest]) ** 2).sum(axis=1))
    return np.array(chosen)
