"""One object: its shape, what it is made of, its twin and how it really is."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from model.predictor.prior_mean import PriorMeanPredictor
from model.priors.materials import MATERIALS, typical
from model.scenes.anchors import anchor
from model.scenes.case import Anchors, ObjectClass, Truth
from model.scenes.looks import paint, wardrobe
from model.scenes.priors import believed, peaked
from model.scenes.world.body import shares
from model.scenes.world.interactions import Handled
from model.scenes.world.materials import Substance, draw_materials, draw_substances
from model.scenes.world.shapes import Shape, draw_shape
from model.scenes.world.truth import World, affordable, fine_graph, make_world
from model.skinning import bind
from model.topology import build_topology
from model.types import (
    STANDARD_GRAVITY,
    Array,
    Controllers,
    Estimate,
    Gaussians,
    MaterialPrior,
    Parts,
    ShapeClass,
    Topology,
)
from model.units import PROPERTY_UNITS

GAUSSIANS = 1100
"""That fill an object, about."""
PLACES = 1000
"""On its surface."""
TWIN_POINTS = {"solid": (220, 600), "sheet": (150, 600), "rope": (150, 500)}
"""Mass points of a twin; a limb should be some points thick."""
FINER = {"solid": (2.0, 3.0), "sheet": (1.6, 2.4), "rope": (2.0, 3.0)}
"""Points of the world over those of the twin."""
FEWEST = 5
"""Mass points that every part has."""
TANGENT = 0.004
"""How far the points lie that say how a surface has turned [m]."""
BEARING = 12.0
"""Least modulus of a part over the object's weight on its mean section."""
OPACITY = 0.95
KNOWN = 0.05
"""Spread of the density, which is known in generated cases."""


@dataclass(frozen=True)
class Thing:
    """One object in its own pose."""

    name: str
    shape: Shape
    substances: tuple[Substance, ...]
    gaussians: Gaussians
    priors: tuple[MaterialPrior, ...]
    """Right ones, with the density known."""
    topology: Topology
    """The twin's, with nothing that holds it; its springs tell nothing of what the parts are made of."""
    informed: Topology
    """The same points with the springs that the right priors ask for: by them the world's hands and dashpots
    are measured."""
    dashpot: float
    """Of each spring of `informed` [N·s/m]."""
    world: World
    truth: Truth
    exact: tuple[MaterialPrior, ...]
    """Beliefs that are the truth."""
    handled: Handled
    """Its surface, normals and where it is taken."""
    spacing: float
    """Between neighbouring places of the surface [m]."""
    world_anchors: tuple[Anchors, Anchors, Anchors]
    """How the surface follows the world: places, and two points beside each."""
    twin_anchors: Anchors
    """How the places of the surface follow the twin."""


def draw_thing(name: str, object_class: ObjectClass, rng: np.random.Generator) -> Thing:
    """One object of a class."""
    while True:
        shape = draw_shape(object_class, rng)
        gaussians, parts = fill(shape, rng)
        if np.bincount(parts.labels, minlength=shape.body.parts).min() < 3:
            continue
        volume = np.bincount(parts.labels, gaussians.volumes.astype(np.float64))
        substances = _bearing(shape, volume, rng)
        priors = _right(substances, shape.shape_class, rng)
        count = int(np.exp(rng.uniform(*np.log(TWIN_POINTS[shape.shape_class]))))
        join = partial(
            build_topology,
            gaussians,
            Parts(parts.labels, shape.body.parts),
            shape_class=shape.shape_class,
            controllers=Controllers(np.zeros((2, 0, 3), np.float32), np.zeros(0, np.int64)),
            bind=bind,
            point_count=count,
            seed=int(rng.integers(2**31)),
        )
        informed = join(priors=priors)
        if np.bincount(informed.part, minlength=shape.body.parts).min() >= FEWEST:
            topology = join(priors=_blind(shape, substances, *rng.spawn(1)))
            colored = paint(gaussians, parts, [one.material for one in substances], wardrobe(name))
            return _completed(name, shape, substances, colored, priors, topology, informed, rng)


def _bearing(shape: Shape, volume: Float64[Array, " K"], rng: np.random.Generator) -> tuple[Substance, ...]:
    """Materials such that no part of a solid collapses under the object's weight."""
    while True:
        substances = draw_substances(shape.object_class, shape.shape_class, len(volume), rng)
        load = STANDARD_GRAVITY[2] * float(np.dot([one.density for one in substances], volume))
        pressure = -load / float(volume.sum()) ** (2.0 / 3.0)
        softest = min(one.stiffness for one in substances)
        if shape.shape_class != "solid" or softest >= BEARING * pressure:
            return substances


def fill(shape: Shape, rng: np.random.Generator) -> tuple[Gaussians, Parts]:
    """Gaussians of equal volume that fill the body, grey, and the part of each."""
    means = shape.body.fill(GAUSSIANS, rng)
    spacing = float(np.median(cKDTree(means).query(means, 2)[0][:, 1]))
    flat = 0.3 if shape.shape_class == "sheet" else 1.0
    count = len(means)
    gaussians = Gaussians(
        means=means.astype(np.float32),
        scales=np.tile(0.6 * spacing * np.array([1.0, 1.0, flat]), (count, 1)).astype(np.float32),
        quaternions=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)).astype(np.float32),
        opacities=np.full(count, OPACITY, np.float32),
        colors=np.full((count, 3), 0.6, np.float32),
        volumes=shares(shape.body, means).astype(np.float32),
    )
    return gaussians, Parts(shape.body.part(means).astype(np.int32), shape.body.parts)


def with_density(
    priors: Sequence[MaterialPrior], substances: Sequence[Substance]
) -> tuple[MaterialPrior, ...]:
    """The same beliefs, but the density is known."""
    return tuple(
        replace(
            prior,
            properties={
                **prior.properties,
                "density": Estimate(substance.density, KNOWN, PROPERTY_UNITS["density"]),
            },
        )
        for prior, substance in zip(priors, substances, strict=True)
    )


def _right(
    substances: Sequence[Substance], shape_class: ShapeClass, rng: np.random.Generator
) -> tuple[MaterialPrior, ...]:
    beliefs = {one.material: believed(peaked(one.material, rng), shape_class) for one in substances}
    return with_density([beliefs[one.material] for one in substances], substances)


def _blind(
    shape: Shape, substances: Sequence[Substance], rng: np.random.Generator
) -> tuple[MaterialPrior, ...]:
    """Beliefs to join a twin by, of materials that are drawn anew for each part.

    So springs are as dense as an expert may have them, but no twin carries a hint of the truth to where the
    prior is undecided or wrong. The density is the known one, which nobody is kept from.
    """
    drawn = draw_materials(shape.object_class, len(substances), rng)
    beliefs = [believed(peaked(material, rng), shape.shape_class) for material in drawn]
    return with_density(beliefs, substances)


def _completed(
    name: str,
    shape: Shape,
    substances: tuple[Substance, ...],
    gaussians: Gaussians,
    priors: tuple[MaterialPrior, ...],
    topology: Topology,
    informed: Topology,
    rng: np.random.Generator,
) -> Thing:
    """The object with its world, its truth and its surface.

    Of these only what is said of the twin's springs depends on how they were joined: the dashpot in the
    truth, which is such that they resist as the world's do.
    """
    body, shape_class = shape.body, shape.shape_class
    count = int(len(informed.points) * rng.uniform(*FINER[shape_class]))
    graph = fine_graph(body, substances, shape_class, count, rng)
    density = np.array([one.density for one in substances])
    wanted = np.array([one.stiffness for one in substances])
    modulus = affordable(graph, wanted, density, shape_class)
    exact = _exact(substances, modulus, shape_class)
    known = PriorMeanPredictor().from_priors(informed, exact, shape_class, STANDARD_GRAVITY, 0.0)
    value = {key: float(one.value) for key, one in known.globals.items() if isinstance(one.value, float)}
    viscosity = value["dashpot_damping"] * _squares(informed)
    world = make_world(
        graph, substances, shape_class, modulus, viscosity, value["friction"], value["restitution"], rng
    )
    truth = Truth(
        material=np.array([one.material for one in substances]),
        modulus=modulus,
        dashpot_damping=viscosity / _squares(topology),
        drag_rate=float(np.average(world.drag_rate, weights=graph.mass)),
        friction=value["friction"],
        restitution=value["restitution"],
    )
    places = body.surface(PLACES, rng)
    normals = body.normals(places)
    handled = Handled(places, normals, shape.grips, float(modulus.min()), shape_class == "solid")
    return Thing(
        name=name,
        shape=shape,
        substances=substances,
        gaussians=gaussians,
        priors=priors,
        topology=topology,
        informed=informed,
        dashpot=value["dashpot_damping"],
        world=world,
        truth=truth,
        exact=exact,
        handled=handled,
        spacing=float(np.median(cKDTree(places).query(places, 2)[0][:, 1])),
        world_anchors=_beside(places, normals, graph),
        twin_anchors=anchor(places, topology.points, topology.springs),
    )


def _squares(topology: Topology) -> float:
    """Σ L² over the springs [m²]."""
    return float((topology.rest_length.astype(np.float64) ** 2).sum())


def _exact(
    substances: Sequence[Substance], modulus: Float64[Array, " K"], shape_class: ShapeClass
) -> tuple[MaterialPrior, ...]:
    """Beliefs that are the truth."""
    beliefs = []
    for substance, stiffness in zip(substances, modulus, strict=True):
        values = {name: float(getattr(substance, name)) for name in PROPERTY_UNITS} | {
            "stiffness": float(stiffness)
        }
        rows = typical(MATERIALS[substance.material], shape_class)
        properties = {name: replace(rows[name], mean=value) for name, value in values.items()}
        certain = np.eye(len(MATERIALS))[substance.material]
        beliefs.append(MaterialPrior(certain, properties, shape_class))
    return tuple(beliefs)


def _beside(
    places: Float64[Array, "M 3"], normals: Float64[Array, "M 3"], graph: Topology
) -> tuple[Anchors, Anchors, Anchors]:
    """Anchors of places and of a point beside each in two directions along the surface."""
    helper = np.where(np.abs(normals[:, 2:]) < 0.8, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    first = np.cross(helper, normals)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    points, springs = graph.points, graph.springs
    return (
        anchor(places, points, springs),
        anchor(places + TANGENT * first, points, springs),
        anchor(places + TANGENT * second, points, springs),
    )
