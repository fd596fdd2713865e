"""A twin that was given, as the plain twin of an observation."""

import math
import warnings
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from model.bundle import TwinBundle
from model.errors import InputError
from model.formats.parameters import gravity, ground_height, scalar
from model.gap.bodies.body import Body, grip_of, with_skin
from model.gap.bodies.guess import guess_shape
from model.gap.bodies.rest import rest_places
from model.gap.bodies.rope import is_line, is_thick
from model.gap.by_graph import by_graph
from model.gap.graph import Graph
from model.gap.matter import Matter
from model.gap.noise import noise_of
from model.gap.plain import PlainTwin
from model.gap.registration import onto_twin
from model.gap.same_hand import led
from model.observation_doubts import hangs
from model.schema import EffectRecord
from model.types import Array, Observation

MOST = 300
"""Points of a graph that a diagnosis, which rolls it out thousands of times, can afford."""
MERGED = 200
"""Points of a coarser one, at most, about as many as plain twins of observations have: one of 271 points, of
1,500, needs five times as many springs and time steps as one of 173, and leaves as much."""
LOOKED_AT = 1500
"""Points from which the shape of a twin is told."""
CORNERS = 8
"""An observed point is between this many mass points."""
DISTANCE = 1e-2
"""What a weight on a point one spacing away costs, over what being a spacing off costs."""
NOTHING: Int64[Array, "0 2"] = np.zeros((0, 2), np.int64)
"""What a hand holds of which it is not known yet."""
GROUND, GRAVITY = 0.01, 0.02
"""How far [m], and by what share, ground and gravity of a recording may differ from the twin's unsaid."""


def given_twin(bundle: TwinBundle, observation: Observation, most: int = MOST) -> PlainTwin:
    """A twin as what an observation is compared with; its parameters are where a fit starts.

    Ground and gravity are those of the observation, which may have been moved onto the twin: go on with the
    `observation` of what is returned.

    Args:
        bundle: The twin.
        observation: What moved.
        most: Points; a finer twin is made coarser, of `MERGED` at most, and a warning says so.

    Raises:
        InputError: the first frame of the observation is not the object of the twin, or its hand is too far
            from the twin to hold any of it, and yet the object does not fall.
    """
    fine = Graph.of(bundle)
    observation = onto_twin(observation, fine.points, fine.spacing)
    graph, became = fine.within(most if len(fine.points) <= most else min(most, MERGED))
    if graph is not fine:
        warnings.warn(
            f"the twin's {len(fine.points)} points were merged into {len(graph.points)} for the diagnosis: "
            "its baseline is that of the coarser twin",
            stacklevel=2,
        )
    _compare_places(bundle, observation)
    carried = bundle.effects
    if graph is not fine:
        carried = tuple(
            by_graph(thinned(record, became, len(graph.points)), fine, graph) for record in bundle.effects
        )
    body = _body(graph, fine, observation)
    controls = led(graph, body.grasp, bundle.controls, observation)
    if controls is not None:
        guessed = Matter.guessed(replace(body, grip=NOTHING), observation)
        matter = _held(_matter(graph, bundle, guessed), graph)
        return replace(PlainTwin.of(body, observation, matter, controls), carried=carried)
    near = grip_of(body.points, observation.controllers[0].astype(np.float64), body.grasp)
    if not len(near):
        _let_go(body, observation)
    elif len(graph.grip):
        warnings.warn(
            "the controllers do not start where the twin's do: how firmly they hold it is a guess until it "
            "is refitted, and its baseline is of that guess",
            stacklevel=2,
        )
    hand = PlainTwin.of(replace(body, grip=near), observation)
    matter = _matter(graph, bundle, hand.matter)
    return replace(PlainTwin.of(hand.body, observation, matter, hand.controls), carried=carried)


def thinned(record: EffectRecord, became: Int64[Array, " P"], count: int) -> EffectRecord:
    """An effect on a graph of so many points of which each is the mean of those that became it."""
    if record.acts_on is None:
        return record
    acts = np.bincount(became, record.acts_on, minlength=count) / np.bincount(became, minlength=count).clip(1)
    return record.model_copy(update={"acts_on": tuple(float(share) for share in acts)})


def bound(
    seen: Float64[Array, "N 3"], points: Float64[Array, "P 3"], spacing: float
) -> tuple[Int64[Array, "N k"], Float64[Array, "N k"]]:
    """Each seen place as a weighted sum of the points near it, the nearest above all.

    Args:
        seen: NaN for one that is never seen.
        points: Of the twin [m].
        spacing: Of these [m].
    """
    asked = np.where(np.isfinite(seen), seen, points[0])
    count = min(CORNERS, len(points))
    index = cKDTree(points).query(asked, k=count)[1].astype(np.int64).reshape(len(seen), count)
    way = (points[index] - asked[:, None]) / spacing
    away = DISTANCE * ((way**2).sum(-1) + 1e-3)
    cost = way @ way.swapaxes(1, 2) + away[:, :, None] * np.eye(count)
    weight = np.linalg.solve(cost, np.ones((len(seen), count, 1)))[..., 0]
    return index, weight / weight.sum(1, keepdims=True)


def _body(graph: Graph, fine: Graph, observation: Observation) -> Body:
    """With the grip of the twin's own hand."""
    points, spacing, seen = graph.points, graph.spacing, rest_places(observation)
    index, weight = bound(seen, points, spacing)
    share: Float64[Array, " P"] = graph.mass / graph.mass.sum()
    shape = guess_shape(fine.points[:: math.ceil(len(fine.points) / LOOKED_AT)])
    body = Body(shape, points, graph.springs, share, index, weight, graph.grip, spacing)
    thick = is_line(graph.springs, len(points)) and is_thick(seen, points, noise_of(observation))
    return with_skin(body, seen, points, observation.ground_height) if thick else body


def _matter(graph: Graph, bundle: TwinBundle, guessed: Matter) -> Matter:
    """The twin's own, held as was guessed."""
    usual = float(np.median(graph.stiffness))
    start = {
        **guessed.start,
        "stiffness": usual,
        "damping": graph.damping / (2.0 * float(np.sqrt(usual * np.median(graph.mass)))),
        "drag_rate": scalar(bundle.parameters, "drag_rate", 0.0),
        "prestress": 0.0,
        "friction": scalar(bundle.parameters, "friction", 0.0),
    }
    return replace(
        guessed,
        mass=graph.mass,
        pattern=graph.stiffness / usual,
        length=graph.rest_length,
        start=start,
        given=True,
        restitution=scalar(bundle.parameters, "restitution", 0.0),
        collision_distance=scalar(bundle.parameters, "collision_distance", 0.0),
        bending_decay=scalar(bundle.parameters, "bending_decay", 0.0),
        slackness=0.0,
    )


def _held(matter: Matter, graph: Graph) -> Matter:
    """Held by the springs of the twin's hand."""
    firm = float(np.median(graph.grip_stiffness))
    return replace(
        matter,
        start={**matter.start, "grip": firm / matter.start["stiffness"]},
        grip_pattern=graph.grip_stiffness / firm,
        grip_length=graph.grip_length,
        hold=None,
    )


def _let_go(body: Body, observation: Observation) -> None:
    """Say of hands that they are too far from a body to hold any of it."""
    hands = observation.controllers[0].astype(np.float64)
    if not len(hands):
        return
    away = float(cKDTree(body.points).query(hands)[0].min())
    far = f"controllers: the nearest is {away:.2g} m from the twin in the first frame and holds none of it"
    if hangs(replace(observation, controllers=observation.controllers[:, :0])):
        raise InputError(f"{far}, and yet the object does not fall: expected them where it is held")
    warnings.warn(f"{far}: it moves as if there was no hand", stacklevel=3)


def _compare_places(bundle: TwinBundle, observation: Observation) -> None:
    for difference in _differences(bundle, observation):
        warnings.warn(f"{difference}: the observation's word counts", stacklevel=3)


def _differences(bundle: TwinBundle, observation: Observation) -> Iterator[str]:
    """In what the place of a recording is not that of the twin."""
    own, other = ground_height(bundle.parameters), observation.ground_height
    if (own is None) != (other is None):
        has, lacks = ("observation", "twin") if own is None else ("twin", "observation")
        yield f"the {has} has a ground, the {lacks} none"
    elif own is not None and other is not None and abs(own - other) > GROUND:
        yield f"the observation's ground is {1e3 * (other - own):+.0f} mm from the twin's"
    given, here = np.array(gravity(bundle.parameters)), np.array(observation.gravity)
    if np.linalg.norm(given - here) > GRAVITY * max(float(np.linalg.norm(given)), 1e-9):
        told = ", ".join(f"{value:.2f}" for value in here)
        yield f"the observation's gravity ({told} m/s², as the twin stands) is not the twin's"
