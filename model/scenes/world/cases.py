"""One object → its cases: the same twin in several interactions, seen by one sensor or another."""

from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Float32, Float64
from scipy.spatial.transform import Rotation

from model.predictor.prior_mean import PriorMeanPredictor
from model.priors.materials import normalised
from model.scenes.case import Anchors, Case, Interaction, ObjectClass
from model.scenes.generated_name import GeneratedName
from model.scenes.priors import believed
from model.scenes.replay import observed, replay
from model.scenes.room import check_near
from model.scenes.world.interactions import ALL_INTERACTIONS, Script, draw_script
from model.scenes.world.materials import LIKELY
from model.scenes.world.sensor import (
    RIG,
    Sensor,
    Surface,
    choose,
    interrupted,
    lifted,
    look,
    measured_in_space,
    seen,
)
from model.scenes.world.shapes import CLASSES
from model.scenes.world.thing import Thing, draw_thing, with_density
from model.scenes.world.truth import Grip, hold, run_world
from model.topology import GRIP_SPRINGS
from model.types import STANDARD_GRAVITY, Array, Camera, Gaussians, Observation, Parameters, Topology

SPLIT = 0.7
"""Share of the frames that may be learned from."""
INTERACTIONS = (3, 4)
"""Per object."""


def draw_cases(
    seed: int, index: int, object_class: ObjectClass | None = None, interactions: int | None = None
) -> list[Case]:
    """The cases of object number `index` of a world; equal arguments give equal cases.

    Args:
        seed: Of the world.
        index: Of the object; classes take turns unless one is given.
        object_class: What kind of object.
        interactions: How many different ones; None: three or four.

    Raises:
        SimulationDiverged: a state of the world is not finite.
        LeftTheRoom: one is, and nowhere.
    """
    rng = np.random.default_rng([seed, index])
    kind = object_class or CLASSES[index % len(CLASSES)]
    thing = draw_thing(str(GeneratedName(kind, seed, index)), kind, rng)
    count = interactions or int(rng.integers(*INTERACTIONS, endpoint=True))
    chosen = rng.permutation(len(ALL_INTERACTIONS))[:count]
    sensors: tuple[Sensor, Sensor] = ("depth", "camera")
    first = int(rng.integers(2))
    return [
        draw_case(thing, ALL_INTERACTIONS[which], sensors[(first + number) % 2], rng)
        for number, which in enumerate(chosen)
    ]


def draw_case(thing: Thing, interaction: Interaction, sensor: Sensor, rng: np.random.Generator) -> Case:
    """The object in one interaction, as one sensor sees it."""
    script = draw_script(interaction, thing.handled, rng)
    topology = _posed(thing.topology, script)
    moved = run_world(
        thing.world,
        script.rotation,
        script.shift,
        script.controllers,
        _grip(thing, script),
        script.times,
        STANDARD_GRAVITY,
    )
    check_near(moved, moved[0])
    surface = _surface(thing, moved)
    cameras = look(surface, script.hands, 1 if sensor == "camera" else RIG, rng)
    visible = seen(surface, script.hands, cameras)
    chosen = choose(visible, thing.handled.surface, rng)
    points = np.ascontiguousarray(surface.places[:, chosen])
    case = _unseen(
        thing, topology, interaction, script, points, chosen, cameras[0] if sensor == "camera" else None
    )
    if case.camera is None:
        measured = measured_in_space(points, rng)
    else:
        measured = lifted(points, replay(case, reference(thing, case)), case.camera, rng)
    measured[~interrupted(visible[:, chosen], rng)] = np.nan
    return replace(case, observation=replace(case.observation, points=measured))


def reference(thing: Thing, case: Case) -> Parameters:
    """A twin of which nothing but the class is known: the middle of its materials."""
    shape_class = thing.shape.shape_class
    belief = believed(normalised(LIKELY[thing.shape.object_class]), shape_class)
    priors = with_density([belief] * len(thing.substances), thing.substances)
    return PriorMeanPredictor().from_priors(case.topology, priors, shape_class, STANDARD_GRAVITY, 0.0)


def _unseen(
    thing: Thing,
    topology: Topology,
    interaction: Interaction,
    script: Script,
    points: Float32[Array, "T N 3"],
    chosen: Array,
    camera: Camera | None,
) -> Case:
    """The case with its points where they really are."""
    anchors = thing.twin_anchors
    return Case(
        name=f"{thing.name}-{interaction}",
        object_name=thing.name,
        object_class=thing.shape.object_class,
        interaction=interaction,
        shape_class=thing.shape.shape_class,
        topology=topology,
        priors=thing.priors,
        observation=Observation(script.times, points, script.controllers, 0.0),
        rest=_moved(thing.handled.surface[chosen], script),
        anchors=Anchors(anchors.index[chosen], anchors.weight[chosen]),
        split=int(SPLIT * len(script.times)),
        camera=camera,
        gaussians=_turned(thing.gaussians, script),
        complete=points,
        truth=thing.truth,
    )


def _surface(thing: Thing, moved: Float32[Array, "T P 3"]) -> Surface:
    """Where the surface is and which way it faces."""
    points = torch.as_tensor(moved)
    places, first, second = (observed(anchors, points).numpy() for anchors in thing.world_anchors)
    normals = np.cross(first - places, second - places)
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-12)
    thin = thing.shape.shape_class == "rope"
    return Surface(places.astype(np.float32), normals.astype(np.float32), thing.spacing, thin)


def _posed(topology: Topology, script: Script) -> Topology:
    """The twin where the object lies, held by the script's hands."""
    points = _moved(topology.points, script)
    pairs, lengths = hold(points, script.controllers[0], GRIP_SPRINGS)
    return replace(
        topology,
        points=points,
        controller_points=script.controllers[0],
        controller_springs=pairs,
        controller_rest_length=lengths,
    )


def _grip(thing: Thing, script: Script) -> Grip:
    """How firmly the hands hold a twin that was joined by the right priors: the world knows no other."""
    topology = _posed(thing.informed, script)
    known = PriorMeanPredictor().from_priors(
        topology, thing.exact, thing.shape.shape_class, STANDARD_GRAVITY, 0.0
    )
    firm = known.controller_stiffness.astype(np.float64)
    return Grip(topology.controller_springs, firm, thing.dashpot, topology.points)


def _moved(points: Float32[Array, "N 3"] | Float64[Array, "N 3"], script: Script) -> Float32[Array, "N 3"]:
    return np.asarray(points.astype(np.float64) @ script.rotation.T + script.shift, np.float32)


def _turned(gaussians: Gaussians, script: Script) -> Gaussians:
    """The Gaussians in the object's pose."""
    first = Rotation.from_matrix(script.rotation)
    own = Rotation.from_quat(gaussians.quaternions[:, [1, 2, 3, 0]])
    quaternions = (first * own).as_quat()[:, [3, 0, 1, 2]]
    return replace(
        gaussians, means=_moved(gaussians.means, script), quaternions=quaternions.astype(np.float32)
    )
