"""A rope: points along its middle line."""

import numpy as np
from jaxtyping import Float64, Int64

from model.gap.bodies.grip import hands_of
from model.gap.bodies.leading import leads
from model.gap.bodies.path import along
from model.types import Array, Observation

SLICES = 26
"""Across a rope, whose means are its middle line."""
ROPE_POINTS = 45
"""Along a rope, at least about: a rope of half as many that hangs swings otherwise."""
APART = 0.5
"""Of the distance of mass points: what is seen nearer to each other along a rope is one. The spring between
would be stiff and light, need the finest time steps of all, and be as long as noise makes it."""
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
    line = _with_ends(_middle(places, away, length), seen, observation, length)
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


def _middle(
    places: Float64[Array, "N 3"], away: Float64[Array, " N"], length: float
) -> Float64[Array, "n 3"]:
    """Few points: they are the line. Many: means of slices across it."""
    if len(places) <= SLICES:
        return _thinned(places[np.argsort(away, kind="stable")], APART * length / ROPE_POINTS)
    bins = np.clip((SLICES * away / length).astype(int), 0, SLICES - 1)
    slices = [bins == b for b in range(SLICES) if (bins == b).any()]
    line = np.stack([places[own].mean(0) for own in slices])
    # the middle of the last slice is not the end of the rope
    short = away[slices[0]].mean() - away.min(), away.max() - away[slices[-1]].mean()
    line[0] += short[0] * _direction(line[1], line[0])
    line[-1] += short[1] * _direction(line[-2], line[-1])
    return line


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
