"""A twin of fewer points and springs that moves the same within a measured deviation, for real-time use."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float32, Int32, Int64

from model.errors import InputError
from model.exports.coarse_graph import coarse_mass, coarse_springs, match_stiffness, scatter
from model.exports.mechanics import roll
from model.formats.parameters import scalar
from model.skinning import bind
from model.types import Array, Parameter, Topology

if TYPE_CHECKING:
    from model.bundle import TwinBundle

FOLLOWED = 8
"""Points that each Gaussian follows."""
FACTORS = (0.35, 0.6, 1.0, 1.7)
"""On all stiffness: those tried first."""


@dataclass(frozen=True)
class Coarse:
    """The smaller twin, and how far it is from the whole one."""

    twin: "TwinBundle"
    kept: Int64[Array, " n"]
    """Which points of the whole twin its points are."""
    deviation: Mapping[str, float]
    """`max_m` and `mean_m` [m] over points and frames of the recorded motion; `travel_m`: how far the points
    move in it, at most; `points`, `springs`, `substeps` per frame, `whole_substeps`; `stiffness_factor`."""

    @property
    def statement(self) -> str:
        """One sentence with the numbers."""
        d, whole = self.deviation, "the whole twin"
        return (
            f"coarsened to {d['points']:.0f} points and {d['springs']:.0f} springs ({d['substeps']:.0f} "
            f"substeps per frame, {whole} takes {d['whole_substeps']:.0f}); under the recorded motion its "
            f"points are {1e3 * d['mean_m']:.2g} mm from the same points of {whole} on average and "
            f"{1e3 * d['max_m']:.2g} mm at most, of up to {1e3 * d['travel_m']:.3g} mm that they move"
        )


def coarsen(twin: "TwinBundle", count: int) -> Coarse:
    """Keep about `count` points, and give them masses and springs such that they move as before.

    The kept points lie farthest apart along the springs, held ones first. Their masses keep the total mass,
    the centre of mass and, where masses stay positive, the moments of inertia. Two are joined where the
    points around them are; their stiffness has, around each point, the elastic energy of every affine
    deformation that the springs there had. One factor on all of it is then fitted to the recorded motion,
    since a network does not deform affinely between its points. The dashpot dissipates the same in an affine
    deformation.

    Args:
        twin: Without effects, which belong to its own points.
        count: How many points; springs follow.

    Raises:
        InputError: more points than there are, fewer than there are pieces, or a twin without springs or with
            effects.

    Reference:
        Gonzalez (1985), Clustering to minimize the maximum intercluster distance; Hrennikoff (1941), Solution
        of problems of elasticity by the framework method (the energy of a network of springs).
    """
    total = len(twin.topology.points)
    if not 8 <= count < total:
        raise InputError(f"--points {count}: this twin has {total} points, give 8 to {total - 1}")
    if not len(twin.topology.springs):
        raise InputError(f"--points {count}: this twin has no springs to make fewer of: leave --points out")
    if twin.effects:
        raise InputError(
            f"--points: the effect {twin.effects[0].name} belongs to the points of the whole twin"
        )
    kept, owner = scatter(twin.topology, count)
    small = _build(twin, kept, owner)
    whole = roll(twin)
    best, factor = _fit(small, whole.points[:, kept])
    motion = roll(best)
    away = np.linalg.norm(motion.points - whole.points[:, kept], axis=-1)
    travel = np.linalg.norm(whole.points - whole.points[0], axis=-1)
    deviation = {
        "max_m": float(away.max()),
        "mean_m": float(away.mean()),
        "travel_m": float(travel.max()),
        "points": float(len(kept)),
        "springs": float(len(best.topology.springs)),
        "substeps": motion.metadata["substeps_per_frame"],
        "whole_substeps": whole.metadata["substeps_per_frame"],
        "stiffness_factor": factor,
    }
    coarse = Coarse(best, kept, deviation)
    warnings = (*best.manifest.warnings, coarse.statement)
    return replace(
        coarse, twin=replace(best, manifest=best.manifest.model_copy(update={"warnings": warnings}))
    )


def _build(twin: "TwinBundle", kept: Int64[Array, " n"], owner: Int64[Array, " N"]) -> "TwinBundle":
    """The smaller twin before its stiffness is fitted."""
    topology, parameters = twin.topology, twin.parameters
    springs = coarse_springs(topology, kept, owner)
    points = topology.points[kept]
    stiffness = match_stiffness(topology, parameters.stiffness, kept, owner, springs)
    length = np.linalg.norm(points[springs[:, 0]] - points[springs[:, 1]], axis=1)
    grips, grip_length, grip_stiffness = _grips(twin, points, owner)
    index, weight = bind(twin.gaussians.means, points, k=FOLLOWED, springs=springs)
    small = Topology(
        points=points,
        mass=coarse_mass(topology, kept, owner),
        springs=springs,
        rest_length=(length * _stretch(topology)).astype(np.float32),
        part=topology.part[kept],
        binding_index=index,
        binding_weight=weight,
        controller_points=topology.controller_points,
        controller_springs=grips,
        controller_rest_length=grip_length,
    )
    # An affine deformation strains every spring alike: dampers dissipate in proportion to the sum of L².
    share = float(
        (topology.rest_length.astype(np.float64) ** 2).sum() / (length.astype(np.float64) ** 2).sum()
    )
    dashpot = Parameter(scalar(parameters, "dashpot_damping", 0.0) * share, "N*s/m", "fitted")
    return replace(
        twin,
        topology=small,
        parameters=replace(
            parameters,
            stiffness=stiffness.astype(np.float32),
            controller_stiffness=grip_stiffness,
            globals={**parameters.globals, "dashpot_damping": dashpot},
        ),
        parts=tuple(part.model_copy(update={"stiffness": None, "size": None}) for part in twin.parts),
        preview=None,
    )


def _stretch(topology: Topology) -> float:
    """Rest length over distance at rest, over all springs."""
    ends = topology.points.astype(np.float64)[topology.springs]
    apart = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    return float(topology.rest_length.astype(np.float64).sum() / apart.sum())


def _grips(
    twin: "TwinBundle", points: Float32[Array, "n 3"], owner: Int64[Array, " N"]
) -> tuple[Int32[Array, "s 2"], Float32[Array, " s"], Float32[Array, " s"]]:
    """Controller springs to the kept points, those to the same point as one; as stretched as they were."""
    topology, stiffness = twin.topology, twin.parameters.controller_stiffness.astype(np.float64)
    if not len(topology.controller_springs):
        return (
            topology.controller_springs,
            topology.controller_rest_length,
            twin.parameters.controller_stiffness,
        )
    hand, point = topology.controller_springs.T.astype(np.int64)
    apart = np.linalg.norm(topology.controller_points[hand] - topology.points[point], axis=1)
    slack = topology.controller_rest_length.astype(np.float64) - apart
    pairs, which = np.unique(np.stack([hand, owner[point]], axis=1), axis=0, return_inverse=True)
    which = which.ravel()
    total = np.bincount(which, stiffness)
    loose = np.bincount(which, stiffness * slack) / np.maximum(total, 1e-30)
    distance = np.linalg.norm(topology.controller_points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    length = np.maximum(distance + loose, 1e-6)
    return pairs.astype(np.int32), length.astype(np.float32), total.astype(np.float32)


def _fit(small: "TwinBundle", truth: Float32[Array, "T n 3"]) -> "tuple[TwinBundle, float]":
    """The factor on all stiffness with which it follows best, by trying some and the vertex between them."""

    def scaled(factor: float) -> "TwinBundle":
        stiffness = small.parameters.stiffness * np.float32(factor)
        return replace(small, parameters=replace(small.parameters, stiffness=stiffness))

    def miss(factor: float) -> float:
        try:
            return float(np.linalg.norm(roll(scaled(factor)).points - truth, axis=-1).mean())
        except InputError:  # it diverges: no candidate
            return float("inf")

    misses = {factor: miss(factor) for factor in FACTORS}

    def best_of() -> float:
        """Of those that follow alike, as where nothing moves, the one that changes least."""
        return min(misses, key=lambda factor: (misses[factor], abs(math.log(factor))))

    best = best_of()
    for step in (1.3, 1.14):
        for factor in (best / step, best * step):
            misses.setdefault(factor, miss(factor))
        best = best_of()
    if not np.isfinite(misses[best]):
        raise InputError("--points: the smaller twin diverges: give more points")
    return scaled(best), best
