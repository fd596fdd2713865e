"""The world that cases are taken from: a finer graph with other springs than the twin's."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float32, Float64, Int32
from scipy.spatial import cKDTree

from model.predictor.lattice import lattice_stiffness
from model.predictor.stability import fastest, stable_step
from model.scenes.anchors import anchor
from model.scenes.replay import observed
from model.scenes.world.body import Body, shares
from model.scenes.world.materials import Substance
from model.simulator.build import build_simulator
from model.types import Array, ShapeClass, Topology

SUBSTEPS = 230
"""Substeps per frame of 1/30 s that the world may cost: what is stiffer is as soft as that."""
MARGIN = 1.2
"""Of the stability bound, as the simulator takes it."""
GIVING = 1.2
"""How much stiffer the springs of the world are than their lattice's formula says: sparse graphs give where
denser ones do not. So the formula for the twin with the true modulus is right on average
(benchmarks/scenes/floor.py)."""
UNEVEN = 0.15
"""Standard deviation of the logarithm of the modulus within a part."""
LIGHTEST = 0.3
"""The lightest point weighs at least this much of the median one, so that it does not set the time step."""
SHARED = 3
"""Points of the world that share what a hand's spring does to one point of the twin."""
SHORTEST, FARTHEST = 0.3, 2.0
"""Of a hand's springs: the least length, and how much longer than the shortest, in spacings."""


@dataclass(frozen=True)
class World:
    """One object as it really is."""

    topology: Topology
    """At rest, with nothing that holds it."""
    stiffness: Float64[Array, " E"]
    """[N/m]."""
    dashpot: Float64[Array, " E"]
    """[N·s/m]."""
    drag_rate: Float64[Array, " N"]
    """[1/s]."""
    friction: float
    """[1]."""
    restitution: float
    """[1]."""
    modulus: Float64[Array, " K"]
    """Of each part [Pa]."""


@dataclass(frozen=True)
class Grip:
    """How hands hold an object: as firmly in the world as in the twin, and as deep."""

    pairs: Int32[Array, "S 2"]
    """(controller, point of the twin)."""
    stiffness: Float64[Array, " S"]
    """[N/m]."""
    dashpot: float
    """Of each of the twin's springs [N·s/m]."""
    points: Float32[Array, "N 3"]
    """Of the twin, in the pose in which it is taken [m]."""


def fine_graph(
    body: Body,
    substances: tuple[Substance, ...],
    shape_class: ShapeClass,
    count: int,
    rng: np.random.Generator,
) -> Topology:
    """About `count` points that fill the body, each joined with all within a reach that is drawn."""
    points = body.fill(count, rng)
    dimension = 2.0 if shape_class == "sheet" else 3.0
    spacing = float(np.median(cKDTree(points).query(points, 2)[0][:, 1]))
    wanted = rng.uniform(11.0, 15.0) if shape_class == "sheet" else rng.uniform(20.0, 28.0)
    thickness = 4.0 * np.pi / 3.0 if dimension == 3.0 else np.pi
    reach = (wanted / thickness) ** (1.0 / dimension) * (body.volume() / len(points)) ** (1.0 / 3.0)
    if shape_class == "sheet":
        reach = float(np.sqrt(wanted / np.pi)) * 1.08 * spacing
    pairs = cKDTree(points).query_pairs(max(reach, 1.5 * spacing), output_type="ndarray")
    for share in (0.3, 0.5, 0.7):
        middle = (1.0 - share) * points[pairs[:, 0]] + share * points[pairs[:, 1]]
        pairs = pairs[body.inside(middle, 0.1 * spacing)]
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].astype(np.int32)
    part = body.part(points).astype(np.int32)
    density = np.array([substance.density for substance in substances])[part]
    places = points.astype(np.float32)
    return Topology(
        points=places,
        mass=_shared(density * shares(body, points)).astype(np.float32),
        springs=pairs,
        rest_length=_lengths(places, pairs),
        part=part,
        binding_index=np.zeros((0, 4), np.int32),
        binding_weight=np.zeros((0, 4), np.float32),
        controller_points=np.zeros((0, 3), np.float32),
        controller_springs=np.zeros((0, 2), np.int32),
        controller_rest_length=np.zeros(0, np.float32),
    )


def part_volumes(topology: Topology, density: Float64[Array, " K"]) -> Float64[Array, " K"]:
    """Volume of each part [m³]: the mass of its points over its density."""
    mass = np.bincount(topology.part, topology.mass.astype(np.float64), minlength=len(density))
    return np.asarray(mass / density, np.float64)


def affordable(
    topology: Topology,
    modulus: Float64[Array, " K"],
    density: Float64[Array, " K"],
    shape_class: ShapeClass,
) -> Float64[Array, " K"]:
    """The moduli [Pa], the stiffest of them lowered until `SUBSTEPS` per frame suffice."""
    volume, specific = part_volumes(topology, density), modulus / density
    nothing = np.zeros(0)
    for _ in range(4):
        stiffness = lattice_stiffness(topology, specific * density, volume, shape_class)
        # a fifth more for the hands, which are not there yet
        needed = MARGIN / (30.0 * stable_step(1.2 * GIVING * fastest(topology, stiffness, nothing), 0.0))
        if needed <= SUBSTEPS:
            break
        specific = np.minimum(specific, specific.max() * (0.97 * SUBSTEPS / needed) ** 2)
    return np.asarray(specific * density, np.float64)


def make_world(
    topology: Topology,
    substances: tuple[Substance, ...],
    shape_class: ShapeClass,
    modulus: Float64[Array, " K"],
    viscosity: float,
    friction: float,
    restitution: float,
    rng: np.random.Generator,
) -> World:
    """The object as it really is.

    Args:
        topology: The fine graph.
        substances: Of its parts.
        shape_class: Sheet, rope or solid.
        modulus: Of its parts [Pa].
        viscosity: Σ γ L² over its springs [N·m·s] for the mean damping ratio: what dashpots of any graph of
            this object share.
        friction: [1].
        restitution: [1].
        rng: For how the modulus varies within the parts.
    """
    density = np.array([substance.density for substance in substances])
    volume = part_volumes(topology, density)
    stiffness = lattice_stiffness(topology, modulus, volume, shape_class)
    stiffness = GIVING * stiffness * _uneven(topology, rng)
    ratio = np.log([substance.damping for substance in substances])
    ratio = np.exp(ratio - ratio @ volume / volume.sum())
    length = topology.rest_length.astype(np.float64)
    dashpot = ratio[topology.part[topology.springs]].mean(axis=1) * viscosity / (length**2).sum()
    drag = np.array([substance.drag_rate for substance in substances])[topology.part]
    return World(topology, stiffness, dashpot, drag, friction, restitution, modulus)


def run_world(
    world: World,
    rotation: Float64[Array, "3 3"],
    shift: Float64[Array, " 3"],
    controllers: Float32[Array, "T C 3"],
    grip: Grip,
    times: Float64[Array, " T"],
    gravity: tuple[float, float, float],
) -> Float32[Array, "T N 3"]:
    """Where the points of the world are [m], from rest at a pose, pulled by controllers; the ground is z = 0.

    Raises:
        SimulationDiverged: a state is not finite.
    """
    rest = world.topology.points.astype(np.float64)
    topology = replace(world.topology, points=(rest @ rotation.T + shift).astype(np.float32))
    pairs, lengths, share = _taken(topology.points, controllers[0], grip)
    firm, held_back = share.T
    damping = np.concatenate([world.dashpot, held_back])
    simulator = build_simulator(
        points=topology.points,
        mass=topology.mass,
        springs=topology.springs,
        rest_length=topology.rest_length,
        stiffness=world.stiffness.astype(np.float32),
        controller_springs=pairs,
        controller_rest_length=lengths,
        controller_stiffness=firm.astype(np.float32),
        controller_points=controllers[0],
        dashpot_damping=damping.astype(np.float32),
        drag_rate=world.drag_rate.astype(np.float32),
        friction=world.friction,
        restitution=world.restitution,
        gravity=gravity,
        ground_height=0.0,
    )
    motion = torch.as_tensor(controllers) if controllers.shape[1] else None
    with torch.no_grad():
        points = simulator.rollout(None, motion, times=times).points
    return np.asarray(points.numpy(), np.float32)


def follow(
    world: World, places: Float64[Array, "N 3"], moved: Float32[Array, "T P 3"]
) -> Float32[Array, "T N 3"]:
    """Where places of the body at rest are [m] while the points of the world move."""
    anchors = anchor(places, world.topology.points, world.topology.springs)
    return observed(anchors, torch.as_tensor(moved)).numpy().astype(np.float32)


def hold(
    points: Float32[Array, "N 3"], controllers: Float32[Array, "C 3"], count: int
) -> tuple[Int32[Array, "S 2"], Float32[Array, " S"]]:
    """Springs from each controller to the `count` points nearest to it, none without length [m]."""
    if not len(controllers):
        return np.zeros((0, 2), np.int32), np.zeros(0, np.float32)
    tree = cKDTree(points)
    spacing = float(np.median(tree.query(points, 2)[0][:, 1]))
    wanted = min(count + 2, len(points))
    distance, index = tree.query(controllers, wanted)
    held = (distance >= SHORTEST * spacing) & (distance <= distance[:, :1] + FARTHEST * spacing)
    held[~held.any(axis=1), -1] = True
    held &= np.cumsum(held, axis=1) <= count
    owner = np.repeat(np.arange(len(controllers))[:, None], wanted, axis=1)
    return np.stack([owner[held], index[held]], axis=1).astype(np.int32), distance[held].astype(np.float32)


def _taken(
    points: Float32[Array, "N 3"], controllers: Float32[Array, "C 3"], grip: Grip
) -> tuple[Int32[Array, "S 2"], Float32[Array, " S"], Float64[Array, "S 2"]]:
    """A grip of the twin, each spring shared by the world's points around its end.

    Returns:
        Pairs (controller, point), their lengths [m], and stiffness [N/m] and dashpot [N·s/m] of each.
    """
    if not len(grip.pairs):
        return np.zeros((0, 2), np.int32), np.zeros(0, np.float32), np.zeros((0, 2))
    tree = cKDTree(points)
    near = tree.query(grip.points[grip.pairs[:, 1]], SHARED)[1]
    owner = np.repeat(grip.pairs[:, :1], SHARED, axis=1)
    length = np.linalg.norm(points[near] - controllers[owner], axis=2)
    shortest = SHORTEST * float(np.median(tree.query(points, 2)[0][:, 1]))
    used = length >= np.minimum(shortest, length.max(axis=1, keepdims=True))
    share = (used / used.sum(axis=1, keepdims=True))[used]
    firm = np.repeat(grip.stiffness[:, None], SHARED, axis=1)[used] * share
    keys, place = np.unique(owner[used].astype(np.int64) * len(points) + near[used], return_inverse=True)
    pairs = np.stack([keys // len(points), keys % len(points)], axis=1).astype(np.int32)
    lengths = np.linalg.norm(points[pairs[:, 1]] - controllers[pairs[:, 0]], axis=1).astype(np.float32)
    both = [np.bincount(place, value, len(keys)) for value in (firm, grip.dashpot * share)]
    return pairs, lengths, np.stack(both, axis=1)


def _shared(mass: Float64[Array, " N"]) -> Float64[Array, " N"]:
    """The same total, but no point much lighter than the others."""
    raised = np.maximum(mass, LIGHTEST * np.median(mass))
    return np.asarray(raised * mass.sum() / raised.sum(), np.float64)


def _uneven(topology: Topology, rng: np.random.Generator) -> Float64[Array, " E"]:
    """A factor per spring, smooth in space, whose logarithm averages zero over each part."""
    points = topology.points.astype(np.float64)
    scale = 2.0 * np.pi / float(np.ptp(points, axis=0).max())
    waves = rng.normal(0.0, scale, (6, 3))
    level = np.sin(points @ waves.T + rng.uniform(0.0, 2.0 * np.pi, 6)).sum(axis=1)
    for part in range(int(topology.part.max()) + 1):
        own = topology.part == part
        level[own] -= level[own].mean()
    level *= UNEVEN / max(float(level.std()), 1e-9)
    return np.asarray(np.exp(level[topology.springs].mean(axis=1)), np.float64)


def _lengths(points: Float32[Array, "N 3"], springs: Int32[Array, "E 2"]) -> Float32[Array, " E"]:
    return np.asarray(np.linalg.norm(points[springs[:, 0]] - points[springs[:, 1]], axis=1), np.float32)
