"""Where the mass points of a body are in another recording of its object, in which other points were tracked.

Two clips of one object have tracks of their own. What they share is its shape: a body is made of the other
recording, too, and this one is laid on it.
"""

import math
import warnings
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from model.errors import InputError
from model.gap.bodies.body import Body, body_of
from model.gap.bodies.rope import is_line
from model.gap.bodies.turns import nearest_rotation
from model.gap.registration import TURNS, Motion, rigid_motion
from model.gap.size import size_of
from model.types import Array, Observation

SETTLING = 15
"""Steps as a whole, from each of these."""
STIFF = (30.0, 10.0, 3.0, 10.0)
"""How much its own shape counts against what is nearest, in the steps after that: it bends when it lies there
as a whole, and what is nearest is another point in each step."""
BENDING = 6
"""Steps with each."""
CHOICES = 8
"""Of the places found as a whole, the nearest to what is seen, that are tried with bending."""
SIZES = 1.5
"""Times: an object that measures more, or less, is another one."""
OFF = 1.0
"""Spacings that it may be off what is seen, root mean square, and be the object still: points that fill the
same shape otherwise are off by half of one."""
AS_WELL = 1.25
"""Times as far off as the nearest: another place is as good, and what is nearer to where it was is taken."""
MARKED = 0.8
"""Colours and parts tell places apart where they differ so much less in one."""
APART = math.radians(60.0)
"""Turns that differ by less are one place."""


class FoldedOtherwiseError(InputError):
    """A cloth of the right size hangs or lies in folds that cannot be laid on the other recording."""


class Laid(NamedTuple):
    """A body on what another recording shows."""

    points: Float64[Array, "P 3"]
    """Its mass points there [m]."""
    off: float
    """How far they are from what is seen there, and that from them [m], root mean square."""


def posed_by_shape(body: Body, before: Observation, after: Observation) -> Float64[Array, "P 3"]:
    """The mass points where the shape of what is seen says that they are [m].

    Where it fits in several ways, as a square cloth does, marks decide: colours and parts, if both recordings
    have them; else the way that is nearest to how it lay before. A warning says what was taken.

    Args:
        body: Of the first recording.
        before: The first recording.
        after: The other one.

    Raises:
        FoldedOtherwiseError: both are cloths of one size, and one cannot be laid on the other.
        InputError: the other recording shows an object of another size, or of another shape, or too little
            of it: of a solid one plane alone, in which it could be laid flat.

    Reference:
        Amberg, Romdhani and Vetter (2007), Optimal step nonrigid ICP algorithms for surface registration,
        IEEE conference on computer vision and pattern recognition.
    """
    try:
        target = body_of(after, body.shape)
    except InputError as error:
        raise InputError(f"the other recording: {error}") from error
    one, other = (_length(each) for each in (body, target))
    if not 1.0 / SIZES <= other / one <= SIZES:
        raise InputError(
            f"points: the object of the other recording measures {other:.3g} m, that of the first "
            f"{one:.3g} m: is it the same object?"
        )
    ways = (_along_line if _lines(body, target) else _on_shape)(body, target)
    best = min(way.off for way in ways)
    if best > OFF * max(body.spacing, target.spacing):
        away = f"the object of the first recording is {1e3 * best:.2g} mm off that of the other"
        if body.shape == "sheet":
            raise FoldedOtherwiseError(f"points: {away} however it is folded")
        raise InputError(f"points: {away} wherever it is laid: is it the same object?")
    fitting = [way for way in ways if way.off <= AS_WELL * best]
    chosen, by = _chosen(fitting, body, before, after)
    told = f", which fits in {len(fitting)} ways: {by} was taken" if len(fitting) > 1 else ""
    warnings.warn(
        "the points of the other recording are not those of the first: where each is on the object was told "
        f"by its shape alone{told}",
        stacklevel=4,
    )
    return chosen.points


def _length(body: Body) -> float:
    """How large a body is, however it is bent, as far as that can be told [m]."""
    if body.shape != "rope" or not is_line(body.springs, len(body.points)):
        return size_of(body.points)
    return float(np.linalg.norm(np.diff(body.points, axis=0), axis=1).sum())


def _lines(*bodies: Body) -> bool:
    return all(each.shape == "rope" and is_line(each.springs, len(each.points)) for each in bodies)


def _along_line(body: Body, target: Body) -> list[Laid]:
    """A rope on the line of the other, from either end, middle on middle, as long as it was."""
    arc, there = (_arc(each.points) for each in (body, target))
    ways = []
    for line in (target.points, target.points[::-1]):
        marks = _arc(line)
        wanted = arc - 0.5 * arc[-1] + 0.5 * there[-1]
        points = np.stack([np.interp(wanted, marks, line[:, i]) for i in range(3)], 1)
        for end, inner, beyond in ((0, 1, -wanted), (-1, -2, wanted - marks[-1])):
            ahead = line[end] - line[inner]
            ahead = ahead / np.linalg.norm(ahead)
            points += np.clip(beyond, 0.0, None)[:, None] * ahead
        off = float(np.sqrt(np.mean(cKDTree(points).query(line)[0] ** 2)))
        ways.append(Laid(points, off))
    return ways


def _arc(line: Float64[Array, "n 3"]) -> Float64[Array, " n"]:
    arc: Float64[Array, " n"] = np.concatenate(
        [[0.0], np.linalg.norm(np.diff(line, axis=0), axis=1).cumsum()]
    )
    return arc


def _on_shape(body: Body, target: Body) -> list[Laid]:
    """A sheet or a solid on the points of the other: as a whole from all sides, then bent onto it.

    From turns about the vertical, on this side and on the other, and from all ways in which its longest
    extents may go with those that are seen.
    """
    tree = cKDTree(target.points)
    sides = Rotation.from_rotvec([[0.0, 0.0, 0.0], [np.pi, 0.0, 0.0]])
    upright = [
        (Rotation.from_rotvec([0.0, 0.0, turn]) * side).as_matrix() for side in sides for turn in TURNS
    ]
    here, there = (_extents(each.points) for each in (body, target))
    any_way = [there @ way.as_matrix() @ here.T for way in Rotation.create_group("O")]
    found = [_settled(body.points, target.points, tree, start) for start in (*upright, *any_way)]
    found.sort(key=lambda motion: _pairs(motion(body.points), target.points, tree)[2])
    apart: list[Motion] = []
    for motion in found:
        if len(apart) < CHOICES and all(_between(motion.rotation, known.rotation) > APART for known in apart):
            apart.append(motion)
    return [_bent(motion(body.points), body, target.points, tree) for motion in apart]


def _extents(points: Float64[Array, "P 3"]) -> Float64[Array, "3 3"]:
    """Directions in which points extend most, second, least: columns of a rotation."""
    axes: Float64[Array, "3 3"] = np.linalg.svd(points - points.mean(0), full_matrices=False)[2].T
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    return axes


def _between(one: Float64[Array, "3 3"], other: Float64[Array, "3 3"]) -> float:
    """Angle from one rotation to another [rad]."""
    return float(Rotation.from_matrix(one.T @ other).magnitude())


def _settled(
    points: Float64[Array, "P 3"],
    target: Float64[Array, "Q 3"],
    tree: cKDTree,
    rotation: Float64[Array, "3 3"],
) -> Motion:
    """From a rotation, middle on middle, the body as a whole, drawn to what is nearest both ways.

    Reference:
        Besl and McKay (1992), A method for registration of 3-D shapes, IEEE Transactions on Pattern Analysis
        and Machine Intelligence 14.
    """
    motion = Motion(rotation, target.mean(0) - rotation @ points.mean(0))
    for _ in range(SETTLING):
        own, theirs, _ = _pairs(motion(points), target, tree)
        motion = rigid_motion(points[own], target[theirs])
    return motion


def _bent(points: Float64[Array, "P 3"], body: Body, target: Float64[Array, "Q 3"], tree: cKDTree) -> Laid:
    """A body at `points`, bent onto the target: each to what is nearest, all around it turned at most.

    Reference:
        Sorkine and Alexa (2007), As-rigid-as-possible surface modeling, Symposium on Geometry Processing.
    """
    count = len(points)
    here, there = body.springs.T
    edges = body.points[here] - body.points[there]
    joined = np.zeros((count, count))
    joined[here, there] = joined[there, here] = 1.0
    laplacian = np.diag(joined.sum(1)) - joined
    for stiff in STIFF:
        for _ in range(BENDING):
            own, theirs, _ = _pairs(points, target, tree)
            pulls = np.bincount(own, minlength=count)
            drawn = np.zeros_like(points)
            np.add.at(drawn, own, target[theirs] / pulls[own, None])
            turns = _local_turns(edges, points[here] - points[there], here, there, count)
            kept = 0.5 * ((turns[here] + turns[there]) @ edges[..., None])[..., 0]
            shape = np.zeros_like(points)
            np.add.at(shape, here, kept)
            np.add.at(shape, there, -kept)
            points = cho_solve(cho_factor(np.eye(count) + stiff * laplacian), drawn + stiff * shape)
    return Laid(points, _pairs(points, target, tree)[2])


def _local_turns(
    before: Float64[Array, "E 3"],
    after: Float64[Array, "E 3"],
    here: Int64[Array, " E"],
    there: Int64[Array, " E"],
    count: int,
) -> Float64[Array, "P 3 3"]:
    """By what rotation the springs at each point are turned, in the mean."""
    spread = np.zeros((count, 3, 3))
    each = after[:, :, None] * before[:, None, :]
    np.add.at(spread, here, each)
    np.add.at(spread, there, each)
    return nearest_rotation(spread)


def _pairs(
    points: Float64[Array, "P 3"], target: Float64[Array, "Q 3"], tree: cKDTree
) -> tuple[Array, Array, float]:
    """What of each is nearest to what of the other: pairs, and their distance, root mean square [m]."""
    far, nearest = tree.query(points)
    back, own = cKDTree(points).query(target)
    pairs = np.concatenate([np.arange(len(points)), own]), np.concatenate([nearest, np.arange(len(target))])
    return *pairs, float(np.sqrt(np.mean(np.concatenate([far, back]) ** 2)))


def _chosen(ways: list[Laid], body: Body, before: Observation, after: Observation) -> tuple[Laid, str]:
    """One of several that fit, and what decided."""
    away = [float(np.linalg.norm(way.points - body.points, axis=1).mean()) for way in ways]
    nearest, marks = int(np.argmin(away)), _marks(before, after)
    if len(ways) > 1 and marks is not None:
        differ = [_differs(way, body, after, *marks) for way in ways]
        if min(differ) < MARKED * differ[nearest]:
            return ways[int(np.argmin(differ))], "what colours and parts ask for"
    return ways[nearest], "the nearest to how it lay"


def _marks(
    before: Observation, after: Observation
) -> tuple[Float64[Array, "N f"], Float64[Array, "M f"]] | None:
    """What tells points of either recording apart but their places; None: nothing that both have."""
    here: list[Float64[Array, "N k"]] = []
    there: list[Float64[Array, "M k"]] = []
    if before.colors is not None and after.colors is not None:
        here.append(before.colors / 255.0)
        there.append(after.colors / 255.0)
    if before.parts is not None and after.parts is not None:
        labels = np.union1d(before.parts, after.parts)
        here.append((before.parts[:, None] == labels).astype(np.float64))
        there.append((after.parts[:, None] == labels).astype(np.float64))
    return (np.concatenate(here, 1), np.concatenate(there, 1)) if here else None


def _differs(
    way: Laid, body: Body, after: Observation, here: Float64[Array, "N f"], there: Float64[Array, "M f"]
) -> float:
    """How much the marks of what is seen differ from those of the first recording's points next to it."""
    places, seen = (body.weight[..., None] * way.points[body.index]).sum(1), after.points[0]
    shown = np.isfinite(seen[:, 0])
    nearest = cKDTree(places).query(seen[shown])[1]
    return float(np.linalg.norm(there[shown] - here[nearest], axis=1).mean())
