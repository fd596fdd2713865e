"""Mass points and springs for an object of which only moving surface points are known."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from model.errors import InputError
from model.gap.bodies.aside import Aside
from model.gap.bodies.borne import is_borne
from model.gap.bodies.bridged import bridged
from model.gap.bodies.guess import Shape, guess_shape
from model.gap.bodies.hidden import hidden_points, hiding
from model.gap.bodies.landed import landed
from model.gap.bodies.neighbours import pairs_within
from model.gap.bodies.reached import bar, held_from_afar
from model.gap.bodies.rest import rest_places
from model.gap.bodies.rope import chain, is_thick
from model.gap.bodies.shares import shares
from model.gap.bodies.sheet import net
from model.gap.bodies.solid import lattice, spans_volume
from model.gap.bodies.tension import stands
from model.gap.bodies.underside import underside
from model.gap.bodies.unfolded import unfolded
from model.gap.noise import noise_of
from model.types import Array, Observation

CORNERS = 6
"""An observed point is between this many mass points."""
REACH = {"sheet": 1.85, "solid": 1.8}
"""Spacings: points nearer than this are joined, in a sheet two rings of neighbours, which are 1 and 1.73 away
(the third is 2), in a solid all around."""
LEAST = 6
"""Neighbours that every point is joined to, however far."""
SOFT = 0.01
"""How far weights give way that would have to be large."""
GRASP = {"rope": 2.0, "sheet": 1.0, "solid": 1.0}
"""Spacings that a hand holds at once; ropes have more points than a hand is small."""


@dataclass(frozen=True)
class Body:
    """An object to simulate: where its mass is, what joins it, and what of it is seen."""

    shape: Shape
    points: Float64[Array, "P 3"]
    """Rest places [m]."""
    springs: Int64[Array, "E 2"]
    share: Float64[Array, " P"]
    """Of the mass, sums to 1."""
    index: Int64[Array, "N k"]
    """The mass points that each observed point is between."""
    weight: Float64[Array, "N k"]
    grip: Int64[Array, "S 2"]
    """(controller, point)."""
    spacing: float
    """Of the points [m]."""
    hold: float | None = None
    """How much of it a hand holds at once [m], where that is known; None: by the spacing."""
    aside: Aside | None = None
    """Of a thick rope, how far observed points are beside its points; None: where their weights put them."""
    above: float = 0.0
    """How far above the ground its points are where it lies on it: of a thick rope, half of that [m]."""

    @property
    def grasp(self) -> float:
        """How much of the object a hand holds at once, about [m]."""
        return GRASP[self.shape] * self.spacing if self.hold is None else self.hold


def body_of(observation: Observation, shape: Shape | None = None, scale: float = 1.0) -> Body:
    """Fill what is seen with mass points and join them.

    Args:
        observation: Its first frame is the rest shape; points not seen there are placed by their neighbours.
        shape: What the object is; None: guessed from how its points lie.
        scale: Of the spacing; another value gives another lattice for the same object.

    Raises:
        InputError: fewer than three points are ever seen, or of what is said to be a solid one plane alone.
    """
    seen = rest_places(observation)
    known = np.isfinite(seen[:, 0])
    places = seen[known]
    if len(places) < 3:
        raise InputError("points: fewer than three are ever seen: nothing to build a body of")
    controllers = observation.controllers[0].astype(np.float64)
    if shape in (None, "solid") and held_from_afar(observation, places):
        return _reaching(seen, controllers, scale)
    shape = shape or shape_of(observation, places)
    if shape != "rope":
        laid_open = unfolded(observation.points[:, known], places)
        if laid_open is not None:
            return _folded(seen, laid_open, controllers, scale)
    points, springs, spacing = _joined(shape, seen, observation, scale)
    index, weight = between(seen, points)
    grip = grip_of(points, controllers, GRASP[shape] * spacing)
    body = Body(shape, points, springs, shares(points, springs, shape, spacing), index, weight, grip, spacing)
    thick = shape == "rope" and is_thick(seen, points, noise_of(observation))
    return with_skin(body, seen, points, observation.ground_height) if thick else body


def shape_of(observation: Observation, places: Float64[Array, "N 3"]) -> Shape:
    """By how its points lie; a sheet that something bears from below is one side of a solid.

    If that has a volume: a plane in the air, of which nothing says how thick it is, is a sheet.

    Args:
        observation: Whose ground and hands count.
        places: Points on the object in the first frame [m].
    """
    shape = guess_shape(places)
    if shape != "sheet" or not (is_borne(observation, places) or stands(observation, places)):
        return shape
    return "solid" if spans_volume(np.concatenate([places, underside(observation, places)])) else "sheet"


def with_skin(
    body: Body, seen: Float64[Array, "N 3"], points: Float64[Array, "P 3"], ground: float | None
) -> Body:
    """A thick rope, whose skin is what is seen of it.

    Args:
        body: A line.
        seen: Where the observed points are in some pose [m]; NaN for those that are never seen.
        points: Where its own points are in that pose [m].
        ground: Height of the ground there [m]; None: there is none.
    """
    aside = Aside.of(seen, points, body.index, body.weight)
    return replace(body, aside=aside, above=aside.height(points, ground))


def _reaching(seen: Float64[Array, "N 3"], controllers: Float64[Array, "C 3"], scale: float) -> Body:
    """From the few points that are seen to the hand, which is far from them and holds the other end."""
    made = bar(seen[np.isfinite(seen[:, 0])], controllers, scale)
    springs = pairs_within(made.points, REACH["solid"] * made.spacing, least=LEAST)
    index, weight = between(seen, made.points)
    grip = grip_of(made.points, controllers, made.girth)
    return Body("solid", made.points, springs, made.share, index, weight, grip, made.spacing, made.girth)


def _folded(
    seen: Float64[Array, "N 3"],
    laid_open: Float64[Array, "n 3"],
    controllers: Float64[Array, "C 3"],
    scale: float,
) -> Body:
    """A sheet, made where it is laid open, and put where what is seen of it is at first."""
    known = np.isfinite(seen[:, 0])
    made, spacing = net(laid_open, scale)
    made, springs = bridged(made, REACH["sheet"] * spacing, LEAST, spacing)
    index, weight = between(made, laid_open)
    points = (weight[..., None] * seen[known][index]).sum(1)
    places = np.full(seen.shape, np.nan)
    places[known] = laid_open
    index, weight = between(places, made)
    grip = grip_of(points, controllers, GRASP["sheet"] * spacing)
    return Body(
        "sheet", points, springs, shares(made, springs, "sheet", spacing), index, weight, grip, spacing
    )


def _joined(
    shape: Shape, seen: Float64[Array, "N 3"], observation: Observation, scale: float
) -> tuple[Float64[Array, "P 3"], Int64[Array, "E 2"], float]:
    """Points, springs and spacing [m], with what a hand hides."""
    if shape == "rope":
        return chain(seen, observation, scale)
    places = seen[np.isfinite(seen[:, 0])]
    if shape == "sheet":
        points, spacing = net(places, scale)
    else:
        below = np.concatenate([underside(observation, places), landed(observation, seen)])
        points, spacing = lattice(np.concatenate([places, below]), scale)
    hands = observation.controllers[0, hiding(points, seen, observation, spacing)].astype(np.float64)
    points = np.concatenate([points, hidden_points(points, hands, shape, spacing)])
    return *bridged(points, REACH[shape] * spacing, LEAST, spacing), spacing


def grip_of(
    points: Float64[Array, "P 3"], controllers: Float64[Array, "C 3"], grasp: float
) -> Int64[Array, "S 2"]:
    """Every controller holds the points within reach of it: `grasp` [m] is how much a hand holds at once."""
    tree = cKDTree(points)
    pairs: list[tuple[int, int]] = []
    for i, place in enumerate(controllers):
        nearest = float(tree.query(place)[0])
        if nearest <= 1.5 * grasp:
            reach = max(0.75 * grasp, 1.05 * nearest)
            pairs += [(i, int(j)) for j in sorted(tree.query_ball_point(place, reach))]
    return np.array(pairs, np.int64).reshape(-1, 2)


def between(
    seen: Float64[Array, "N 3"], points: Float64[Array, "P 3"]
) -> tuple[Int64[Array, "N k"], Float64[Array, "N k"]]:
    """Each observed point as a weighted mean of the nearest mass points, exact where it is one."""
    count = min(CORNERS, len(points))
    asked = np.where(np.isfinite(seen), seen, points[0])
    distance, index = cKDTree(points).query(asked, k=count)
    closeness = 1.0 / (distance + 1e-6 * (1.0 + distance.max())) ** 2
    closeness /= closeness.sum(1, keepdims=True)
    # of all weights that put it exactly where it is, those nearest to closeness: they follow affine motion
    way = points[index] - asked[:, None]
    size = np.sqrt((way**2).sum(-1).mean(1))[:, None, None]
    rows = np.concatenate([np.ones((*index.shape, 1)), way / np.maximum(size, 1e-12)], -1).swapaxes(1, 2)
    square = rows * closeness[:, None] @ rows.swapaxes(1, 2) + SOFT * np.eye(4)
    weight = closeness * (rows.swapaxes(1, 2) @ np.linalg.inv(square)[:, :, :1])[..., 0]
    return index.astype(np.int64), weight / weight.sum(1, keepdims=True)
