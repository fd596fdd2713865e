"""Reflection planes of a point set."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64
from scipy.spatial import cKDTree

from model.types import Array

SAMPLE_COUNT = 600
SCAN_COUNT = 48
REFINED_COUNT = 6
REFINEMENT_ANGLES = (0.12, 0.06, 0.03, 0.015)
"""Steps of the normal [rad], coarse to fine."""
REFINEMENT_OFFSETS = (1.0, 0.5, 0.25, 0.125)
"""Steps of the plane along its normal, in tolerances."""
DISTINCT_COSINE = 0.97
"""Planes whose normals are closer than this are the same plane."""


@dataclass(frozen=True)
class Reflection:
    """A plane {x : normal · x = offset} that maps a point set (nearly) onto itself."""

    normal: Float64[Array, " 3"]
    offset: float
    """[m]."""
    overlap: float
    """Share of the points whose mirror image has a point within the tolerance, 0..1."""

    def __call__(self, points: Float[Array, "N 3"]) -> Float64[Array, "N 3"]:
        """Mirror images of points [m]."""
        mirrored: Float64[Array, "N 3"] = mirror(points, self.normal, self.offset)
        return mirrored


def mirror(points: Float[Array, "N 3"], normal: Float64[Array, " 3"], offset: float) -> Float64[Array, "N 3"]:
    """Points mirrored at the plane normal · x = offset; the normal has length one."""
    distance = np.asarray(points, np.float64) @ normal - offset
    mirrored: Float64[Array, "N 3"] = points - 2.0 * distance[:, None] * normal
    return mirrored


def find_reflections(
    points: Float[Array, "N 3"],
    tolerance: float,
    directions: Sequence[Float64[Array, " 3"]] = (),
    min_overlap: float = 0.85,
    limit: int = 3,
) -> list[Reflection]:
    """Planes at which the point set is symmetric, best first.

    Candidates are the principal axes, the given directions and an even scan of all directions, each through
    the centroid; the best are refined and kept if enough of the reflected points meet the set.

    Args:
        points: Points that fill the object evenly [m].
        tolerance: How far a mirror image may be from its nearest point [m].
        directions: Further normals to try, such as the viewing direction (the mid-surface plane).
        min_overlap: Share of mirror images that must meet a point.
        limit: How many planes to return at most.
    """
    points = np.asarray(points, np.float64)
    search = _Search(points, tolerance)
    axes = np.linalg.eigh(np.cov(points.T))[1].T if len(points) > 3 else np.eye(3)
    normals = [*axes, *(np.asarray(d) / np.linalg.norm(d) for d in directions), *_hemisphere(SCAN_COUNT)]
    scored = sorted(
        ((search.cost(normal, 0.0), index) for index, normal in enumerate(normals)), key=lambda pair: pair
    )
    refined = [search.refine(normals[index], cost) for cost, index in scored[:REFINED_COUNT]]
    refined.sort(key=lambda each: each[0])
    kept: list[Reflection] = []
    for _, normal, shift in refined:
        overlap = search.overlap(normal, shift)
        known = any(abs(float(each.normal @ normal)) > DISTINCT_COSINE for each in kept)
        if overlap >= min_overlap and not known and len(kept) < limit:
            kept.append(Reflection(normal, float(normal @ search.centroid) + shift, overlap))
    return kept


class _Search:
    """Scores planes on a fixed sample of the points."""

    def __init__(self, points: Float64[Array, "N 3"], tolerance: float) -> None:
        self.tree = cKDTree(points)
        self.centroid: Float64[Array, " 3"] = points.mean(axis=0)
        self.tolerance = tolerance
        order = np.random.default_rng(0).permutation(len(points))
        self.sample = points[order[:SAMPLE_COUNT]]

    def distances(self, normal: Float64[Array, " 3"], shift: float) -> Float64[Array, " n"]:
        """From each mirror image to its nearest point, in tolerances, capped at 3."""
        images = mirror(self.sample, normal, float(normal @ self.centroid) + shift)
        found, _ = self.tree.query(images, distance_upper_bound=3.0 * self.tolerance)
        capped: Float64[Array, " n"] = np.minimum(found / self.tolerance, 3.0)
        return capped

    def cost(self, normal: Float64[Array, " 3"], shift: float) -> float:
        return float(self.distances(normal, shift).mean())

    def overlap(self, normal: Float64[Array, " 3"], shift: float) -> float:
        return float((self.distances(normal, shift) <= 1.0).mean())

    def refine(self, normal: Float64[Array, " 3"], cost: float) -> tuple[float, Float64[Array, " 3"], float]:
        """Pattern search over the two angles of the normal and the offset."""
        shift = 0.0
        for angle, step in zip(REFINEMENT_ANGLES, REFINEMENT_OFFSETS, strict=True):
            first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
            first /= np.linalg.norm(first)
            second = np.cross(normal, first)
            turns = [normal + sign * angle * axis for axis in (first, second) for sign in (1.0, -1.0)]
            moves = [(turn / np.linalg.norm(turn), shift) for turn in turns]
            moves += [(normal, shift + sign * step * self.tolerance) for sign in (1.0, -1.0)]
            costs = [self.cost(*move) for move in moves]
            best = int(np.argmin(costs))
            if costs[best] < cost:
                cost, (normal, shift) = costs[best], moves[best]
        return cost, normal, shift


def _hemisphere(count: int) -> Float64[Array, "count 3"]:
    """Directions spread evenly over half the sphere (a Fibonacci lattice)."""
    index = np.arange(count) + 0.5
    height = index / count
    turn = index * np.pi * (1.0 + 5.0**0.5)
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
