"""Where the mass points of a body are in another recording, by points that were tracked in both."""

import warnings

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from model.errors import InputError
from model.gap.bodies.body import Body
from model.types import Array

UNBENT = 0.3
"""How much mass points are moved alike, against where the observed points are seen: those that nobody sees go
with their neighbours, and noise does not crumple the body."""
STRAIGHT = 4.0
"""The same of the line of a thick rope, of which more is seen than its points are many. A rope that is stiff
along itself flies apart where noise of a few millimetres strains its short springs."""
AGAIN = 5
"""Times that the line within a skin is laid anew."""


def posed(body: Body, before: Float64[Array, "N 3"], after: Float64[Array, "N 3"]) -> Float64[Array, "P 3"]:
    """The mass points where the observed points say that they are [m].

    The body is turned and shifted as a whole, then its points move to where the observed ones are seen, each
    much like those it is joined to.

    Args:
        body: Of the first recording.
        before: Places of the observed points in its first frame [m]; NaN: not known.
        after: The same points in the first frame of the other recording.

    Raises:
        InputError: too few are seen in both.
    """
    both = np.isfinite(before[:, 0]) & np.isfinite(after[:, 0])
    if both.sum() < 3:
        raise InputError(
            "points: fewer than three are seen in both recordings: "
            "give one in which the same points were tracked, in the same order"
        )
    here, there = before[both], after[both]
    with warnings.catch_warnings():
        # a straight rope may be rolled about itself by any angle, its points stay where they are
        warnings.filterwarnings("ignore", "Optimal rotation", UserWarning)
        turn = Rotation.align_vectors(there - there.mean(0), here - here.mean(0))[0]
    points: Float64[Array, "P 3"] = turn.apply(body.points - here.mean(0)) + there.mean(0)
    index, weight = body.index[both], body.weight[both]
    sight = np.zeros((len(index), len(points)))
    np.add.at(sight, (np.arange(len(index))[:, None], index), weight)
    aside = None if body.aside is None else body.aside.rolled(turn.as_matrix())
    uneven = (UNBENT if aside is None else STRAIGHT) * _unevenness(body)
    # where a line is that runs within a skin is known once it is known how it runs
    for _ in range(1 if aside is None else AGAIN):
        line = there if aside is None else there - aside.turned(points)[both]
        wanted = np.concatenate([line - sight @ points, np.zeros_like(points)])
        moved: Float64[Array, "P 3"] = np.linalg.lstsq(np.concatenate([sight, uneven]), wanted, rcond=None)[0]
        points = points + moved
    return points


def _unevenness(body: Body) -> Float64[Array, "P P"]:
    """Of what is said of each mass point, the difference to the mean of those it is joined to."""
    joined = np.zeros((len(body.points), len(body.points)))
    joined[body.springs[:, 0], body.springs[:, 1]] = joined[body.springs[:, 1], body.springs[:, 0]] = 1.0
    uneven: Float64[Array, "P P"] = np.eye(len(body.points)) - joined / np.maximum(
        joined.sum(1, keepdims=True), 1.0
    )
    return uneven
