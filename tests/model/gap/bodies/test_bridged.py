"""One object hangs together, however little of it is seen."""

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from model.gap.bodies.body import LEAST, REACH, body_of
from model.gap.bodies.bridged import bridged
from model.types import Observation

SPACING = 0.012
REACHED = REACH["solid"] * SPACING


def block(low, high):
    axes = (np.arange(a, b + 1e-9, SPACING) for a, b in zip(low, high, strict=True))
    return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)


@pytest.fixture
def parts():
    """Two blocks above each other, 8 cm apart, the lower one wider; and a third 5 cm beside the upper one."""
    return [
        block((0.0, 0.0, 0.2), (0.036, 0.036, 0.25)),
        block((0.0, 0.0, 0.05), (0.12, 0.036, 0.12)),
        block((0.086, 0.0, 0.2), (0.12, 0.036, 0.25)),
    ]


def parts_of(springs, count):
    joined = coo_matrix((np.ones(len(springs)), tuple(springs.T)), shape=(count, count))
    return connected_components(joined, directed=False)[0]


def test_what_hangs_together_stays_as_it_is(parts):
    for each in parts:
        assert bridged(each, REACHED, LEAST, SPACING)[0] is each


def test_bridges_run_where_parts_face_each_other(parts):
    points = np.concatenate(parts)
    made, pairs = bridged(points, REACHED, LEAST, SPACING)
    assert parts_of(pairs, len(made)) == 1
    np.testing.assert_array_equal(made[: len(points)], points)
    bridges = made[len(points) :]
    beside = bridges[bridges[:, 2] > 0.19]
    assert len(beside)
    assert len(beside) < len(bridges)
    assert (beside[:, 0] > 0.036).all()
    assert (beside[:, 0] < 0.086).all()
    below = bridges[bridges[:, 2] < 0.19]
    assert (below[:, 2] > 0.12).all()
    # from the whole underside of what is nearest, not from one point
    assert np.ptp(below[:, 1]) > 2 * SPACING
    apart = np.linalg.norm(made[:, None] - bridges, axis=-1)
    assert np.sort(apart, axis=0)[1].min() >= 0.6 * SPACING - 1e-9


def test_a_body_of_which_the_middle_is_not_seen_does_not_fall_apart():
    """Both ends of a bar that a hand holds by one of them."""
    ends = [block((0.0, 0.0, 0.5), (0.036, 0.036, 0.56)), block((0.0, 0.0, 0.3), (0.036, 0.036, 0.36))]
    places = np.concatenate(ends)
    hand = np.array([[0.0, 0.0, 0.56], [0.036, 0.0, 0.56], [0.0, 0.036, 0.56], [0.018, 0.018, 0.55]])
    repeated = (np.repeat(each[None], 6, 0).astype(np.float32) for each in (places, hand))
    body = body_of(Observation(np.arange(6) / 30, *repeated), "solid")
    assert parts_of(body.springs, len(body.points)) == 1
    middle = (body.points[:, 2] > 0.38) & (body.points[:, 2] < 0.48)
    assert middle.any()
