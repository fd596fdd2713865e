"""A rope: points along its middle line."""

import numpy as np
from jaxtyping import Float64, Int64

from model.gap.bodies.grip import hands_of
from model.gap.bodies.leading import leads
from model.gap.bodies.path import along
from model.gap.noise import noise_of
from model.types import Array, Observation

SLICES = 26
"""Across a rope, whose means are its middle line."""
ROPE_POINTS = 45
"""Along a rope, at least about: a rope of half as many that hangs swings otherwise."""
APART = 0.5
"""Of the distance of mass points: what is seen nearer to each other along a rope is one. The spring between
would be stiff and light, need the finest time steps of all, and be as long as noise makes it."""
THICK = 1.3
"""Times the noise that places are away from the middle line of a rope that is more than a line."""
WINDOW, PASSES, STAYS = 24, 6, 0.05
"""Places along a thick rope by which its middle is told at each mark; how often that is moved to where it is
as far from all of them; and what holds it where they are all on one side, over what moves it."""
HIDDEN, LED = 0.15, 0.6
"""Share of the length that is seen, at most, that a hand hides at an end; and one that is seen to lead it."""


def chain(
    seen: Float64[Array, "N 3"], observation: Observation, scale: float
) -> tuple[Float64[Array, "P 3"], Int64[Array, "E 2"], float]:
    """Points along the middle line from end to end, with controllers at its ends; springs; spacing [m].

    Args:
        seen: Where the observed points are in the first frame [m]; NaN for those that are never seen.
        observation: What they did, and what the controllers did.
        scale: Of the spacing.
    """
    places = seen[np.isfinite(seen[:, 0])]
    away, length = along(places)
    middle = _middle(places, away, length, noise_of(observation))
    line = _with_ends(middle, seen, observation, length)
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    arc = np.concatenate([[0.0], steps.cumsum()])
    wanted = scale * arc[-1] / ROPE_POINTS
    pieces = [
        np.linspace(begin, begin + step, max(1, int(np.ceil(step / wanted))), endpoint=False)
        for begin, step in zip(arc[:-1], steps, strict=True)
    ]
    marks = np.concatenate([*pieces, arc[-1:]])
    points = np.stack([np.interp(marks, arc, line[:, i]) for i in range(3)], -1)
    index = np.arange(len(points))
    return points, np.stack([index[:-1], index[1:]], 1), float(np.median(np.diff(marks)))


def is_line(springs: Int64[Array, "E 2"], count: int) -> bool:
    """Whether springs join so many points in a row, each to the next."""
    row = np.arange(count - 1)
    return np.array_equal(springs, np.stack([row, row + 1], 1))


def is_thick(seen: Float64[Array, "N 3"], line: Float64[Array, "n 3"], noise: float) -> bool:
    """Whether places are farther from a line than noise [m] makes them: they are on a skin.

    Few places are a line of their own, which goes through them.

    Args:
        seen: [m]; NaN for those that are never seen.
        line: Its points, in a row [m].
        noise: Standard deviation of a coordinate [m].
    """
    places = seen[np.isfinite(seen[:, 0])]
    if len(places) <= SLICES or len(line) < 2:
        return False
    away = _projected(places, line)[1]
    return float(np.sqrt(np.mean(away**2))) > THICK * noise


def _middle(
    places: Float64[Array, "N 3"], away: Float64[Array, " N"], length: float, noise: float
) -> Float64[Array, "n 3"]:
    """Few points: they are the line. Many: means of slices across it; of a thick rope it is smooth.

    The mean of a few places on a skin is as far from the middle as the rope is thick, now to this side, now
    to that: a line through such means is too long, and folds where the rope does not.
    """
    if len(places) <= SLICES:
        return _thinned(places[np.argsort(away, kind="stable")], APART * length / ROPE_POINTS)
    bins = np.clip((SLICES * away / length).astype(int), 0, SLICES - 1)
    slices = [bins == b for b in range(SLICES) if (bins == b).any()]
    line = np.stack([places[own].mean(0) for own in slices])
    # the middle of the last slice is not the end of the rope
    short = away[slices[0]].mean() - away.min(), away.max() - away[slices[-1]].mean()
    line[0] += short[0] * _direction(line[1], line[0])
    line[-1] += short[1] * _direction(line[-2], line[-1])
    if not is_thick(places, line, noise):
        return line
    line = _smooth(places, away)
    for _ in range(PASSES):
        line = _centred(line, places)
    return line


def _smooth(places: Float64[Array, "N 3"], away: Float64[Array, " N"]) -> Float64[Array, "n 3"]:
    """A line by weighted linear fits to the places that are near along it.

    Reference:
        Cleveland (1979), Robust locally weighted regression and smoothing scatterplots, Journal of the
        American statistical association 74 (without its robust iterations).
    """
    marks = np.linspace(away.min(), away.max(), 2 * SLICES)
    line = []
    for mark, weight in zip(marks, _near(marks, away), strict=True):
        root, columns = np.sqrt(weight)[:, None], np.stack([np.ones_like(away), away - mark], 1)
        line.append(np.linalg.lstsq(root * columns, root * places, rcond=None)[0][0])
    return np.stack(line)


def _near(marks: Float64[Array, " n"], away: Float64[Array, " N"]) -> Float64[Array, "n N"]:
    """Weights of places that are so far along a line at marks on it: those of about `WINDOW`, the nearest."""
    apart = np.abs(away - marks[:, None])
    reach = np.sort(apart, axis=1)[:, min(WINDOW, len(away)) - 1 :][:, :1] + 1e-9
    weights: Float64[Array, "n N"] = np.clip(1.0 - (apart / reach) ** 3, 0.0, None) ** 3
    return weights


def _centred(line: Float64[Array, "n 3"], places: Float64[Array, "N 3"]) -> Float64[Array, "n 3"]:
    """The line moved to where all places around it are more nearly as far from it.

    A camera sees one side of a rope: the mean of what it sees is not in the middle. One Gauss-Newton step of
    the circles that go through the places near each mark, all of one radius.
    """
    away, apart, outward = _projected(places, line)
    marks = np.concatenate([[0.0], np.linalg.norm(np.diff(line, axis=0), axis=1).cumsum()])
    wide = float(np.median(apart))
    moved = line.copy()
    for i, weight in enumerate(_near(marks, away)):
        across = (weight[:, None] * outward).T
        square = across @ outward + STAYS * weight.sum() * np.eye(3)
        moved[i] += np.linalg.solve(square, across @ (apart - wide))
    # what is bent evenly stays so: marks move by what those beside them do, too
    shift = moved - line
    moved[1:-1] = line[1:-1] + (shift[:-2] + 2.0 * shift[1:-1] + shift[2:]) / 4.0
    return moved


def _projected(
    places: Float64[Array, "N 3"], line: Float64[Array, "n 3"]
) -> tuple[Float64[Array, " N"], Float64[Array, " N"], Float64[Array, "N 3"]]:
    """How far along a line of straight pieces each place is, beyond its ends too, and how far from it [m].

    And the way there from the line, unit vectors.
    """
    way = np.diff(line, axis=0)
    step = np.maximum(np.linalg.norm(way, axis=1), 1e-12)
    share = ((places[:, None] - line[:-1]) * way).sum(-1) / step**2
    low, high = np.zeros(len(step)), np.ones(len(step))
    low[0], high[-1] = -np.inf, np.inf
    share = np.clip(share, low, high)
    beside = places[:, None] - line[:-1] - share[..., None] * way
    apart = np.linalg.norm(beside, axis=-1)
    piece = apart.argmin(1)
    rows = np.arange(len(places))
    begins = np.concatenate([[0.0], step.cumsum()[:-1]])
    near = apart[rows, piece]
    outward = beside[rows, piece] / np.maximum(near, 1e-12)[:, None]
    return begins[piece] + share[rows, piece] * step[piece], near, outward


def _thinned(line: Float64[Array, "n 3"], least: float) -> Float64[Array, "m 3"]:
    """Means of points in a row that are nearer than this to the first of them [m]; both ends stay."""
    groups = [[line[0]]]
    for place in line[1:]:
        if float(np.linalg.norm(place - groups[-1][0])) < least:
            groups[-1].append(place)
        else:
            groups.append([place])
    thinned = np.stack([np.mean(group, axis=0) for group in groups])
    thinned[0], thinned[-1] = line[0], line[-1]
    return thinned


def _direction(start: Float64[Array, "3"], end: Float64[Array, "3"]) -> Float64[Array, "3"]:
    way: Float64[Array, 3] = (end - start) / max(float(np.linalg.norm(end - start)), 1e-12)
    return way


def _with_ends(
    line: Float64[Array, "n 3"], seen: Float64[Array, "N 3"], observation: Observation, length: float
) -> Float64[Array, "m 3"]:
    """Controllers beyond an end of the line, within reach, are part of it: hands hide what they hold."""
    usual = float(np.median(np.linalg.norm(np.diff(line, axis=0), axis=1)))
    controllers = observation.controllers.astype(np.float64)
    hands = hands_of(controllers[0], 1.5 * usual)
    left = [np.flatnonzero(hands == hand) for hand in np.unique(hands)]
    while left:
        places = np.stack([controllers[0, hand].mean(0) for hand in left])
        apart = np.linalg.norm(places[:, None] - line[[0, -1]][None], axis=-1)
        which, end = (int(i) for i in np.unravel_index(int(apart.argmin()), apart.shape))
        hand, place, gap = left.pop(which), places[which], float(apart[which, end])
        tip, inner = (line[0], line[1]) if end == 0 else (line[-1], line[-2])
        if gap > LED * length:
            break
        if gap > max(3.0 * usual, HIDDEN * length):
            near = np.flatnonzero(np.linalg.norm(seen - tip, axis=1) <= 2.0 * usual)
            if not leads(controllers[:, hand].mean(1), observation.points[:, near], gap):
                continue
        if 0.2 * usual < gap and float((place - tip) @ (tip - inner)) > 0:
            line = np.concatenate([place[None], line] if end == 0 else [line, place[None]])
    return line
