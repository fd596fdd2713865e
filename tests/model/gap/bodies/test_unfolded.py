"""Cloths that lie folded upon themselves at first, and part."""

import numpy as np
import pytest

from model.gap.bodies.body import body_of
from model.gap.bodies.unfolded import unfolded
from model.types import Observation

SPACING, COLUMNS, ROWS, FRAMES = 0.03, 14, 9, 40
NOISE = 5e-4


@pytest.fixture
def cloth():
    """Places in a rectangle of cloth [m], shaken a little."""
    u, v = np.meshgrid(np.arange(COLUMNS), np.arange(ROWS), indexing="ij")
    flat = SPACING * np.stack([u, v], -1).reshape(-1, 2).astype(float)
    return flat + np.random.default_rng(0).normal(0, 0.1 * SPACING, flat.shape)


def opening(cloth, least, most):
    """It is bent about its middle by angles from `least` to `most` [rad], in each frame [m]."""
    bend, middle = np.linspace(least, most, FRAMES)[:, None], cloth[:, 0].mean()
    along = cloth[:, 0] - middle
    turned = np.where(along > 0, bend, 0.0)
    x = np.where(along > 0, along * np.cos(turned), along)
    z = 0.4 + along * np.sin(turned)
    points = np.stack([x, np.broadcast_to(cloth[:, 1], x.shape), z], -1)
    return points + np.random.default_rng(1).normal(0, NOISE, points.shape)


def tube(opened):
    """A sleeve of cloth, in each frame as wide as it is `opened` [1]: flat at first, round later [m]."""
    around, high = np.meshgrid(np.arange(20) * np.pi / 10, np.arange(7), indexing="ij")
    radius = 20 * SPACING / (2 * np.pi)
    shape = np.stack([1.4 * np.cos(around), 0.0 * around, SPACING * high / radius], -1).reshape(-1, 3)
    wide = np.sin(around).ravel()
    points = radius * np.repeat(shape[None], len(opened), 0)
    points[..., 0] *= (1.4 - 0.4 * opened[:, None]) / 1.4
    points[..., 1] = radius * opened[:, None] * wide
    return points


def test_a_folded_cloth_is_laid_open(cloth):
    points = opening(cloth, np.deg2rad(172), np.deg2rad(60))
    laid = unfolded(points, points[0])
    assert laid is not None
    apart, true = (
        np.linalg.norm(places[:, None] - places[None], axis=-1)[np.triu_indices(len(cloth), 1)]
        for places in (laid, cloth)
    )
    near = true < 1.6 * SPACING
    np.testing.assert_allclose(apart[near], true[near], rtol=0.35)
    assert apart[~near].min() > 1.2 * SPACING
    assert np.corrcoef(apart, true)[0, 1] > 0.97


def test_what_stays_folded_or_was_never_is_left_alone(cloth):
    for least, most in ((172, 168), (40, 0)):
        points = opening(cloth, np.deg2rad(least), np.deg2rad(most))
        assert unfolded(points, points[0]) is None


def test_a_solid_that_is_squeezed_is_left_alone():
    block = SPACING * np.stack(np.meshgrid(*3 * [np.arange(5)], indexing="ij"), -1).reshape(-1, 3)
    by = 1.0 + 0.3 * np.sin(np.linspace(0, 6, FRAMES))[:, None]
    points = np.stack([block[:, 0] / by, block[:, 1] * by, np.broadcast_to(block[:, 2], (FRAMES, 125))], -1)
    assert unfolded(points, points[0]) is None


def test_few_points_are_left_alone():
    points = np.random.default_rng(2).normal(size=(FRAMES, 6, 3))
    assert unfolded(points, points[0]) is None


def test_points_that_are_hidden_for_long_are_laid_open_too(cloth):
    points = opening(cloth, np.deg2rad(172), np.deg2rad(60))
    places = points[0].copy()
    points[10:, 5] = np.nan
    laid = unfolded(points, places)
    assert laid is not None
    assert np.isfinite(laid).all()


def test_its_body_is_a_sheet_whose_folds_are_not_joined(cloth):
    points = opening(cloth, np.deg2rad(172), np.deg2rad(60))
    observation = Observation(
        times=np.arange(FRAMES) / 30.0,
        points=points.astype(np.float32),
        controllers=np.zeros((FRAMES, 0, 3), np.float32),
    )
    body = body_of(observation)
    assert body.shape == "sheet"
    # where in the cloth the mass points are: where the tracked points are that lie between them
    sight = np.zeros((len(body.points), len(cloth)))
    np.add.at(sight, (body.index, np.arange(len(cloth))[:, None]), np.maximum(body.weight, 0.0))
    own = sight.argmax(1)
    ways = np.linalg.norm(cloth[own[body.springs[:, 0]]] - cloth[own[body.springs[:, 1]]], axis=1)
    assert (ways > 4 * SPACING).mean() < 0.02
    tracked = (body.weight[..., None] * body.points[body.index]).sum(1)
    assert np.linalg.norm(tracked - points[0], axis=1).max() < 0.6 * SPACING


def test_a_sleeve_is_no_solid():
    points = tube(np.linspace(0.15, 1.0, FRAMES))
    laid = unfolded(points, points[0])
    assert laid is not None
    around = laid.reshape(20, 7, 3)
    ring = np.linalg.norm(around - np.roll(around, 1, axis=0), axis=-1)
    np.testing.assert_allclose(ring, np.median(ring), rtol=0.5)
    opposite = np.linalg.norm(around - np.roll(around, 10, axis=0), axis=-1)
    assert opposite.min() > 4 * SPACING
