"""Gaussians, parts and what they are made of → mass points and the springs between them."""

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from jaxtyping import Float32, Float64, Int, Int32
from scipy.spatial import cKDTree

from model.errors import InputError
from model.mass_points import place_points, share_mass
from model.spring_graph import join_points, local_spacing
from model.types import Array, Controllers, Gaussians, MaterialPrior, Parts, ShapeClass, Topology

Bind: TypeAlias = Callable[..., tuple[Int32[Array, "G k"], Float32[Array, "G k"]]]
"""`model.skinning.bind`: (means, points, k=, springs=) → indices and weights."""

FOLLOWED = 8
"""Points each Gaussian follows."""
NEIGHBOURS = {"solid": 18.0, "sheet": 12.0, "rope": 18.0}
REACH = {"solid": 2.0, "sheet": 2.2, "rope": 2.4}
"""Springs a point of the reference material asks for, and how far it reaches over the local spacing."""
REFERENCE_STIFFNESS = {"solid": 5e4, "sheet": 2e5, "rope": 2e5}
REFERENCE_DENSITY = {"solid": 150.0, "sheet": 300.0, "rope": 400.0}
GRIP_SPRINGS = 6
"""Springs per controller: enough to hold in every direction."""
SHORTEST_GRIP = 0.3
"""Shortest controller spring over the spacing: a spring without length pushes nowhere."""
GRIP_REACH = 4.0
"""A controller farther than this many spacings from every point does not touch the object."""


def build_topology(
    gaussians: Gaussians,
    parts: Parts,
    priors: Sequence[MaterialPrior],
    shape_class: ShapeClass,
    controllers: Controllers,
    *,
    bind: Bind,
    point_count: int = 1500,
    seed: int = 0,
) -> Topology:
    """Fill the body with mass points and join them.

    Points are spread evenly through the Gaussians (one layer on the middle surface of a sheet, no finer
    than a dozen per section in a rope). Each weighs what the Gaussians nearest to it weigh. How many
    springs a point asks for and how long they may be follow from its part's material (softer or denser:
    more; harder or sparser: fewer) and from the local spacing. Springs run inside the body only; few cross
    from part to part; everything is one piece. Controllers hold the points nearest to where they start,
    and nothing where they start out of reach of all of them.

    Args:
        gaussians: The body.
        parts: Label per Gaussian.
        priors: One per part: stiffness and density.
        shape_class: Sheet, rope or solid.
        controllers: Where the hand holds; C = 0: nothing.
        bind: `model.skinning.bind`.
        point_count: How many points are wanted; fewer where the body is too small for them.
        seed: Of the sampling.

    Raises:
        InputError: fewer than two distinct Gaussians, or priors that do not match the parts.

    Reference:
        Jiang et al. (2025), PhysTwin (springs by radius and neighbour count). The dependence of both on the
        material follows MatPhys: softer or denser parts get denser springs, borders few.
    """
    if len(priors) != parts.count:
        raise InputError(f"topology: {parts.count} parts but {len(priors)} material priors; give one each")
    points, chosen = place_points(gaussians, shape_class, point_count, seed)
    if len(chosen) < 2:
        raise InputError("topology: the reconstruction has no extent; give a larger or clearer object")
    part = parts.labels[chosen].astype(np.int32)
    springs, bridged = _springs(points, part, priors, shape_class, gaussians)
    warnings = [f"{bridged} loose piece(s) joined by their shortest links"] if bridged else []
    density = np.array([prior.properties["density"].mean for prior in priors])[parts.labels]
    grips, grip_lengths, grip_warnings = _hold(points, controllers)
    positions = points.astype(np.float32)
    index, weight = bind(gaussians.means, positions, k=FOLLOWED, springs=springs)
    return Topology(
        points=positions,
        mass=share_mass(points, gaussians, density),
        springs=springs,
        rest_length=_lengths(positions, springs),
        part=part,
        binding_index=index,
        binding_weight=weight,
        controller_points=controllers.motion[0].astype(np.float32),
        controller_springs=grips,
        controller_rest_length=grip_lengths,
        warnings=(*warnings, *grip_warnings),
    )


def density_of_springs(prior: MaterialPrior, shape_class: ShapeClass) -> float:
    """How many springs a material gets over the reference material, 0.7 … 1.5.

    One decade softer: a quarter more; one decade denser: as much again.
    """
    softer = np.log10(REFERENCE_STIFFNESS[shape_class] / prior.properties["stiffness"].mean)
    denser = np.log10(prior.properties["density"].mean / REFERENCE_DENSITY[shape_class])
    return float(np.clip(1.25 ** (softer + denser), 0.7, 1.5))


def _springs(
    points: Float64[Array, "N 3"],
    part: Int[Array, " N"],
    priors: Sequence[MaterialPrior],
    shape_class: ShapeClass,
    gaussians: Gaussians,
) -> tuple[Int32[Array, "E 2"], int]:
    factor = np.array([density_of_springs(prior, shape_class) for prior in priors])[part]
    neighbours = np.round(NEIGHBOURS[shape_class] * factor).astype(int)
    # the volume (area) within reach grows as the number of springs in it
    dimension = 2.0 if shape_class == "sheet" else 3.0
    reach = REACH[shape_class] * factor ** (1.0 / dimension) * local_spacing(points)
    return join_points(points, part, neighbours, reach, gaussians)


def _hold(
    points: Float64[Array, "N 3"], controllers: Controllers
) -> tuple[Int32[Array, "S 2"], Float32[Array, " S"], list[str]]:
    """Springs from each controller in reach to the points nearest to it, none of them without length."""
    starts = controllers.motion[0].astype(np.float64)
    if len(starts) == 0:
        return np.zeros((0, 2), np.int32), np.zeros(0, np.float32), []
    spacing = float(np.median(local_spacing(points)))
    wanted = min(GRIP_SPRINGS + 2, len(points))
    distance, index = cKDTree(points).query(starts, wanted)
    distance, index = distance.reshape(-1, wanted), index.reshape(-1, wanted)
    long_enough = distance >= SHORTEST_GRIP * spacing
    # firm near the hand: nothing much farther than the nearest is held
    near = distance <= distance[:, :1] + 2.0 * spacing
    held = long_enough & near
    held[~held.any(axis=1), -1] = True
    held &= np.cumsum(held, axis=1) <= GRIP_SPRINGS
    away = distance[:, 0] > GRIP_REACH * spacing
    held[away] = False
    warnings = []
    if far := int(away.sum()):
        reach = GRIP_REACH * spacing
        warnings.append(f"{far} controller point(s) start more than {reach:.3f} m away and hold nothing")
    owner = np.repeat(np.arange(len(starts))[:, None], wanted, axis=1)
    pairs = np.stack([owner[held], index[held]], axis=1).astype(np.int32)
    return pairs, distance[held].astype(np.float32), warnings


def _lengths(points: Float32[Array, "N 3"], springs: Int32[Array, "E 2"]) -> Float32[Array, " E"]:
    return np.asarray(np.linalg.norm(points[springs[:, 0]] - points[springs[:, 1]], axis=1), np.float32)
