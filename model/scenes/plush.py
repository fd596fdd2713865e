"""A plush animal on its back, striped, with soft limbs."""

import numpy as np
from jaxtyping import Float32, Float64, Int64
from scipy.spatial import cKDTree

from model.scenes.capsules import Capsules, chain, union
from model.scenes.splats import Coat, coat
from model.skinning import bind
from model.types import Array, Topology

SPACING = 0.0032
"""Between surface Gaussians [m]."""
POINT_SPACING = 0.0125
"""Between mass points [m]."""
REACH = 2.1
"""Springs are at most this long, in spacings."""
DENSITY = 120.0
"""Of a stuffed toy [kg/m³]."""

CREAM, TEAL = np.array([0.93, 0.89, 0.80]), np.array([0.10, 0.50, 0.55])
DARK, PINK = np.array([0.10, 0.11, 0.16]), np.array([0.87, 0.52, 0.50])

BODY = chain((0.0, -0.045, 0.040, 0.038), (0.002, 0.01, 0.045, 0.044), (0.0, 0.055, 0.040, 0.037))
HEAD = chain((0.002, -0.100, 0.042, 0.036), (0.004, -0.128, 0.044, 0.030))
EARS = union(
    chain((-0.028, -0.102, 0.036, 0.011), (-0.046, -0.116, 0.030, 0.012)),
    chain((0.032, -0.104, 0.036, 0.011), (0.050, -0.119, 0.030, 0.012)),
)
EYES = union(chain((-0.013, -0.113, 0.0755, 0.0052)), chain((0.019, -0.114, 0.0755, 0.0052)))
NOSE = chain((0.003, -0.140, 0.0690, 0.0062))
ARMS = union(
    chain((-0.030, -0.035, 0.038, 0.018), (-0.075, -0.045, 0.022, 0.0165), (-0.115, -0.025, 0.0165, 0.0155)),
    chain((0.030, -0.035, 0.038, 0.018), (0.078, -0.030, 0.022, 0.0165), (0.118, -0.052, 0.0165, 0.0155)),
)
LEGS = union(
    chain((-0.020, 0.060, 0.036, 0.019), (-0.048, 0.105, 0.022, 0.0170), (-0.070, 0.155, 0.0165, 0.0155)),
    chain((0.020, 0.060, 0.036, 0.019), (0.052, 0.100, 0.022, 0.0170), (0.092, 0.138, 0.0165, 0.0155)),
)
PAWS = union(
    chain((-0.130, -0.016, 0.020, 0.019)),
    chain((0.133, -0.060, 0.020, 0.019)),
    chain((-0.076, 0.172, 0.020, 0.019)),
    chain((0.107, 0.149, 0.020, 0.019)),
)
PARTS = (BODY, HEAD, EARS, EYES, NOSE, ARMS, LEGS, PAWS)
GRIP = np.array([-0.076, 0.172, 0.022])
"""The middle of the paw that the hand takes [m]."""


def plush_coat(rng: np.random.Generator) -> Coat:
    """Its Gaussians."""
    body = union(*PARTS)
    surface = body.surface(SPACING)
    return coat(body, _pattern(body, surface, rng), surface, SPACING, rng)


def plush_topology(skin: Coat, rng: np.random.Generator) -> Topology:
    """Its mass points and springs, without anything that holds it."""
    body = union(*PARTS)
    points = body.fill(POINT_SPACING, 0.002, rng).astype(np.float32)
    springs = _springs(body, points)
    volume = len(points) * POINT_SPACING**3
    index, weight = bind(skin.gaussians.means, points, springs=springs)
    return Topology(
        points=points,
        mass=np.full(len(points), DENSITY * volume / len(points), np.float32),
        springs=springs.astype(np.int32),
        rest_length=np.linalg.norm(points[springs[:, 0]] - points[springs[:, 1]], axis=1),
        part=np.zeros(len(points), np.int32),
        binding_index=index,
        binding_weight=weight,
        controller_points=np.zeros((0, 3), np.float32),
        controller_springs=np.zeros((0, 2), np.int32),
        controller_rest_length=np.zeros(0, np.float32),
    )


def _springs(body: Capsules, points: Float32[Array, "N 3"]) -> Int64[Array, "E 2"]:
    """Pairs of near points whose connection stays inside the body."""
    pairs = cKDTree(points).query_pairs(REACH * POINT_SPACING, output_type="ndarray")
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    middle = points[pairs].mean(axis=1).astype(np.float64)
    inside: Int64[Array, "E 2"] = pairs[body.distance(middle) < 0]
    return inside


def _pattern(
    body: Capsules, surface: Float64[Array, "P 3"], rng: np.random.Generator
) -> Float64[Array, "P 3"]:
    """Stripes on limbs and flanks, a cream belly and face, dark eyes, coloured paws; fabric grain."""
    owner, along = body.owners(surface)
    part = np.repeat(np.arange(len(PARTS)), [len(one.starts) for one in PARTS])[owner]
    length = np.linalg.norm(body.ends - body.starts, axis=1)
    walked = (np.cumsum(length) - length)[owner] + along * length[owner]
    x, y, z = surface.T
    rings = _mixed(TEAL, CREAM, np.sin(2 * np.pi * walked / 0.026 + 12 * z) - 0.1)
    flanks = _mixed(TEAL, CREAM, np.sin(2 * np.pi * (y + 0.25 * np.abs(x)) / 0.03) - 0.1)
    belly = 1 - (x / 0.026) ** 2 - ((y - 0.01) / 0.045) ** 2
    trunk = _mixed(CREAM, flanks, np.where(z > 0.05, belly, -9.0))
    albedo = np.choose(part[:, None], (trunk, CREAM, TEAL, DARK, PINK, rings, rings, TEAL))
    cloth = np.sin(x * 410) * np.sin(y * 390 + 1) * np.sin(z * 400 + 2)
    grained: Float64[Array, "P 3"] = albedo * (1 + 0.06 * cloth + rng.normal(0, 0.045, len(x)))[:, None]
    return grained.clip(0, 1)


def _mixed(inside: Array, outside: Array, level: Float64[Array, " P"]) -> Float64[Array, "P 3"]:
    """One colour where `level` is above zero, the other below, with a soft edge."""
    share = 1 / (1 + np.exp(-8 * level))[:, None]
    mixed: Float64[Array, "P 3"] = share * inside + (1 - share) * outside
    return mixed
