from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from model.errors import InputError
from model.scenes.carried import carried
from model.types import Gaussians


@pytest.fixture(scope="module")
def case(make_case):
    return make_case(frames=9)


@pytest.fixture(scope="module")
def dots(case):
    means = case.topology.points[::5].copy()
    ones = np.ones(len(means), np.float32)
    upright = np.tile(np.array([1, 0, 0, 0], np.float32), (len(means), 1))
    return Gaussians(means, 0.003 * np.ones_like(means), upright, ones / 2, 0 * means, ones)


def test_rigid_motion_carries_everything_with_it(case, dots):
    turns = Rotation.from_rotvec(np.outer(np.linspace(0.0, 1.4, 9), [0.3, 0.2, 0.9])).as_matrix()
    shift = np.outer(np.arange(9), [0.02, -0.01, 0.03])
    complete = np.einsum("tij,nj->tni", turns, case.rest) + shift[:, None]
    moved = replace(case, complete=complete.astype(np.float32), truth=None)
    for frame, (means, _, turned) in enumerate(carried(moved, dots)):
        expected = dots.means @ turns[frame].T + shift[frame]
        np.testing.assert_allclose(means, expected, atol=2e-4)
        np.testing.assert_allclose(turned, np.broadcast_to(turns[frame], turned.shape), atol=2e-3)


def test_what_is_at_an_observed_point_moves_as_it_does(case, dots):
    rng = np.random.default_rng(0)
    there = case.rest[:30]
    marks = replace(
        dots,
        means=there,
        scales=np.full((30, 3), 0.003, np.float32),
        quaternions=np.tile(np.array([1, 0, 0, 0], np.float32), (30, 1)),
        opacities=np.full(30, 0.5, np.float32),
        colors=np.zeros((30, 3), np.float32),
        volumes=np.ones(30, np.float32),
    )
    bent = (
        case.rest
        + 0.4 * case.rest[:, :1] ** 2 / 0.15 * [0.0, 0.0, 1.0]
        + rng.normal(0, 2e-4, case.rest.shape)
    )
    complete = np.stack([case.rest, *[bent] * 8]).astype(np.float32)
    moved = replace(case, complete=complete, truth=None)
    means = [frame[0] for frame in carried(moved, marks)]
    np.testing.assert_allclose(means[0], there, atol=1e-5)
    off = np.linalg.norm(means[1] - bent[:30], axis=1)
    assert np.linalg.norm(bent - case.rest, axis=1).max() > 0.03
    assert np.median(off) < 3e-4
    assert off.max() < 2e-3


def test_what_nobody_observed_moves_as_the_twin_does(case, dots):
    """Half of the points are hidden: the truth still says where that half of the bar goes."""
    truth = [frame[0] for frame in carried(case, dots)]
    seen = np.flatnonzero(case.rest[:, 0] > 0.07)
    half = replace(
        case,
        rest=case.rest[seen],
        anchors=replace(case.anchors, index=case.anchors.index[seen], weight=case.anchors.weight[seen]),
        observation=replace(case.observation, points=case.observation.points[:, seen]),
        complete=case.complete[:, seen],
    )
    known = [frame[0] for frame in carried(half, dots)]
    guessed = [frame[0] for frame in carried(replace(half, truth=None), dots)]
    errors = [np.linalg.norm(means[-1] - truth[-1], axis=1).max() for means in (known, guessed)]
    assert np.linalg.norm(truth[-1] - truth[0], axis=1).max() > 0.02
    assert errors[0] < 0.002
    assert errors[1] > 0.004


def test_without_the_whole_motion_there_is_nothing_to_follow(case, dots):
    with pytest.raises(InputError, match="where all points are"):
        next(carried(replace(case, complete=None), dots))
