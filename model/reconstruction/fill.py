"""Volume → Gaussians: an even layer of flat ones at the surface, round ones inside."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64, Int
from scipy.spatial import cKDTree
from scipy.special import ndtri

from model.reconstruction.volume import Volume
from model.types import Array, Gaussians

TARGET_COUNT = 9_000
OPACITY = 0.95
COARSER_INSIDE = 1.6
"""Spacing inside over spacing at the surface: nobody looks inside."""


@dataclass(frozen=True)
class Filling:
    """Gaussians of a body before they have colours."""

    means: Float64[Array, "G 3"]
    """[m]."""
    normals: Float64[Array, "G 3"]
    """Outward unit normals of surface Gaussians; zero inside."""
    scales: Float64[Array, "G 3"]
    """[m]; the last axis is the normal's."""
    volumes: Float64[Array, " G"]
    """[m³]."""
    spacing: float
    """Mean distance between neighbours [m]."""

    @property
    def surface(self) -> Bool[Array, " G"]:
        """Which ones lie at the surface."""
        at_surface: Bool[Array, " G"] = np.any(self.normals != 0.0, axis=-1)
        return at_surface

    def painted(self, colors: Float[Array, "G 3"], warnings: tuple[str, ...] = ()) -> Gaussians:
        """Gaussians with colours (RGB 0..1)."""
        return Gaussians(
            means=self.means.astype(np.float32),
            scales=self.scales.astype(np.float32),
            quaternions=quaternions_to(self.normals).astype(np.float32),
            opacities=np.full(len(self.means), OPACITY, np.float32),
            colors=np.clip(colors, 0.0, 1.0).astype(np.float32),
            volumes=self.volumes.astype(np.float32),
            warnings=warnings,
        )


FLATTENED = 0.34
"""Standard deviation of surface Gaussians along the normal, in spacings."""
SHEET_SPREAD = 0.6
"""Standard deviation of a sheet's Gaussians in its plane, in spacings."""
INSET = 2.2
"""How far below the surface the outer layer lies, in standard deviations of its blurred footprint."""
PIXEL_BLUR = 0.55
"""Standard deviation that rasterisers add to a footprint, in pixels (0.3 px² of variance)."""


def fill(
    volume: Volume, pixel: float = 0.0, floor: float | None = None, count: int = TARGET_COUNT
) -> Filling:
    """Fill a body with about `count` Gaussians whose volumes sum to the body's.

    The spacing follows from the body's volume and surface; the generator has a fixed seed, so the same
    body gives the same Gaussians.

    Args:
        volume: The body.
        pixel: Size of a pixel at the body [m]: rendering blurs by about half of it, so the outer layer
            lies deeper by that and the outline stays where it is.
        floor: Height of the ground [m]: what lies on it keeps its contact.
        count: How many to aim for.
    """
    candidates, normals = _surface_candidates(volume)
    area = _area(volume)
    spacing = _spacing_for(count, volume.total, area)
    for _ in range(2):  # the packing is only roughly known: correct the spacing by what came out
        means, outward = _place(volume, candidates, normals, spacing, pixel, floor)
        spacing *= float(np.clip((len(means) / count) ** 0.4, 0.8, 1.25))
    means, outward = _place(volume, candidates, normals, spacing, pixel, floor)
    scales = np.full((len(means), 3), 0.62 * COARSER_INSIDE * spacing)
    at_surface = np.any(outward != 0, axis=-1)
    scales[at_surface] = np.array([0.62, 0.62, FLATTENED]) * spacing
    return Filling(means, outward, scales, _shares(volume, means), spacing)


def sheet_filling(
    points: Float64[Array, "G 3"], normals: Float64[Array, "G 3"], spacing: float, thickness: float
) -> Filling:
    """One layer of flat Gaussians, each standing for a tile of `spacing`² × `thickness` [m]."""
    count = len(points)
    scales = np.tile([SHEET_SPREAD * spacing, SHEET_SPREAD * spacing, 0.4 * thickness], (count, 1))
    volumes = np.full(count, spacing**2 * thickness)
    return Filling(points, normals, scales, volumes, spacing)


def sheet_inset(spacing: float, pixel: float) -> float:
    """How far inside the outline of a sheet its outermost Gaussians must lie to be drawn up to it [m].

    Along the edge of an even layer the optical depth falls off like the normal distribution; it is drawn
    up to where that depth is ln 2 (half covered).
    """
    blurred = float(np.hypot(SHEET_SPREAD * spacing, PIXEL_BLUR * pixel))
    whole = 9.05 * (blurred / spacing) ** 2  # 2π times the integral of −ln(1 − 0.95 exp(−r²/2)) r dr
    return float(-ndtri(np.log(2.0) / whole)) * blurred - 0.3 * spacing


def quaternions_to(normals: Float64[Array, "G 3"]) -> Float64[Array, "G 4"]:
    """Shortest rotations (w, x, y, z) that turn +z to each normal; identity where it is zero."""
    quaternions = np.stack(
        [1.0 + normals[:, 2], -normals[:, 1], normals[:, 0], np.zeros(len(normals))], axis=-1
    )
    flipped = (normals[:, 2] < -1.0 + 1e-9) & np.any(normals != 0, axis=-1)
    quaternions[flipped] = [0.0, 1.0, 0.0, 0.0]
    unit: Float64[Array, "G 4"] = quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)
    return unit


def thinned(points: Float64[Array, "N 3"], radius: float) -> Int[Array, " M"]:
    """Indices of a maximal subset of points no two of which are nearer than `radius` [m].

    Reference:
        Luby (1986), A simple parallel algorithm for the maximal independent set problem.
    """
    pairs = cKDTree(points).query_pairs(radius, output_type="ndarray")
    priority = np.random.default_rng(0).permutation(len(points))
    undecided, chosen = np.ones(len(points), bool), np.zeros(len(points), bool)
    while undecided.any():
        best = np.full(len(points), -1)
        np.maximum.at(best, pairs[:, 0], priority[pairs[:, 1]])
        np.maximum.at(best, pairs[:, 1], priority[pairs[:, 0]])
        winners = undecided & (priority > best)
        chosen |= winners
        undecided &= ~winners
        won = winners[pairs]
        undecided[pairs[won[:, 0], 1]] = False
        undecided[pairs[won[:, 1], 0]] = False
        pairs = pairs[undecided[pairs].all(axis=1)]
    return np.nonzero(chosen)[0]


def _surface_candidates(volume: Volume) -> tuple[Float64[Array, "N 3"], Float64[Array, "N 3"]]:
    """Dense points on the surface and outward normals, by Newton steps from the voxels around it."""
    near = np.abs(volume.distance) < 0.9 * volume.spacing
    points = volume.points[near]
    jitter = np.random.default_rng(1).uniform(-0.45, 0.45, points.shape) * volume.spacing
    points = points + jitter
    for _ in range(3):
        slope = volume.gradient(points)
        steepness = np.maximum((slope**2).sum(-1), 0.05)
        step = (volume.sample(points) / steepness)[:, None] * slope
        points = points - np.clip(step, -volume.spacing, volume.spacing)
    slope = volume.gradient(points)
    length = np.linalg.norm(slope, axis=-1)
    good = (length > 1e-3) & (np.abs(volume.sample(points)) < 0.3 * volume.spacing)
    return points[good], -slope[good] / length[good, None]


def _place(
    volume: Volume,
    candidates: Float64[Array, "N 3"],
    normals: Float64[Array, "N 3"],
    spacing: float,
    pixel: float,
    floor: float | None,
) -> tuple[Float64[Array, "G 3"], Float64[Array, "G 3"]]:
    """Surface and interior centres for one spacing."""
    depth = INSET * float(np.hypot(FLATTENED * spacing, PIXEL_BLUR * pixel))
    inset = candidates - depth * normals
    if floor is not None:  # seen from above the underside is no outline: it stays on the ground
        resting = (normals[:, 2] < -0.5) & (candidates[:, 2] - floor < depth)
        inset[resting, 2] = np.maximum(candidates[resting, 2], floor + FLATTENED * spacing)
    # Where the body is thinner than two insets, both sides meet in the middle instead of crossing.
    crossed = volume.sample(inset) < 0.2 * spacing
    inset[crossed] = candidates[crossed] - np.minimum(0.15 * spacing, volume.spacing) * normals[crossed]
    chosen = thinned(inset, 0.87 * spacing)
    surface, outward = inset[chosen], normals[chosen]
    interior = _lattice(volume, COARSER_INSIDE * spacing)
    interior = interior[volume.sample(interior) > max(0.75 * COARSER_INSIDE * spacing, depth)]
    if len(interior):
        gap, _ = cKDTree(surface).query(interior)
        interior = interior[gap > 0.5 * COARSER_INSIDE * spacing]
    means = np.concatenate([surface, interior])
    return means, np.concatenate([outward, np.zeros_like(interior)])


def _lattice(volume: Volume, spacing: float) -> Float64[Array, "N 3"]:
    """A jittered cubic lattice over the volume's grid."""
    size = (np.array(volume.distance.shape) - 1) * volume.spacing
    axes = [np.arange(0.5 * spacing, extent, spacing) for extent in size]
    local = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    local = local + np.random.default_rng(2).uniform(-0.12, 0.12, local.shape) * spacing
    points: Float64[Array, "N 3"] = volume.origin + local @ volume.axes.T
    return points


def _area(volume: Volume) -> float:
    """Surface area [m²] from the slope of the occupancy."""
    slopes = np.gradient(volume.occupancy)
    return float(np.sqrt(sum(slope**2 for slope in slopes)).sum() * volume.spacing**2)


def _spacing_for(count: int, volume: float, area: float) -> float:
    """Spacing [m] at which a surface layer and the interior behind it hold `count` points together."""
    low, high = 1e-6, 1.0
    for _ in range(60):
        spacing = np.sqrt(low * high)
        inside = max(volume - 1.2 * area * spacing, 0.0) / (COARSER_INSIDE * spacing) ** 3
        expected = 0.95 * area / spacing**2 + inside
        low, high = (spacing, high) if expected > count else (low, spacing)
    return float(np.sqrt(low * high))


def _shares(volume: Volume, means: Float64[Array, "G 3"]) -> Float64[Array, " G"]:
    """Each Gaussian's share of the body: the voxels nearest to it, never nothing."""
    occupancy = volume.occupancy
    inside = occupancy > 0
    _, nearest = cKDTree(means).query(volume.points[inside])
    share = np.bincount(nearest, occupancy[inside].astype(np.float64), minlength=len(means))
    share = np.maximum(share, 0.1 * share.mean())
    shares: Float64[Array, " G"] = share * (volume.total / share.sum())
    return shares
