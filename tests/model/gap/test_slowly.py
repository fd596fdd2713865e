"""A slow observer sees what pushes faintly and for long."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.effects import GravityTilt
from model.gap.observer import Observer
from model.gap.slowly import BLOCKS, SLOW, explained_slowly, left_slowly

NOISE = 1e-3
TILT = {"gravity_tilt.about_x": 0.01, "gravity_tilt.about_y": -0.005}


def test_of_the_truth_noise_alone_is_left(hung, studied):
    study = studied(hung, noise=NOISE)
    left = left_slowly(study.misfit, study.base.values)
    assert left.shape == (BLOCKS,)
    np.testing.assert_allclose(left, 1.0, rtol=0.2)


def test_all_frames_are_looked_at_and_what_nobody_sees_is_left_out(hung, studied, study_of):
    study = studied(hung, noise=NOISE)
    points = study.observation.points.copy()
    points[20:25] = np.nan
    points[study.split :] += 0.03
    moved = replace(study.observation, points=points)
    gap = study_of(moved, study.plain.twin, study.base.values, NOISE)
    left = left_slowly(gap.misfit, gap.base.values)
    assert left.shape == (BLOCKS - 1,), "of one block no frame was seen"
    assert left[-1] > 10.0 > 1.5 > left[0]


def test_a_faint_tilt_is_seen_slowly_where_a_quick_observer_hardly_sees_it(hung, studied):
    held = replace(
        hung,
        times=np.arange(90) / 30.0,
        points=np.repeat(hung.points[:1], 90, 0),
        controllers=np.repeat(hung.controllers[:1], 90, 0),
    )
    study = studied(held, (GravityTilt(),), TILT, noise=NOISE)
    quick = study.misfit.through(study.misfit.observer.forgetting(0.15), study.misfit.span)
    right = quick.of(study.plain.with_effect(GravityTilt()))
    vector = right.coordinates.vector({**study.base.values, **TILT})
    without = float((quick(study.base.vector[None]) ** 2).mean())
    once = np.log(without / float((right(vector[None]) ** 2).mean()))
    slowly = explained_slowly(
        left_slowly(quick, study.base.values), left_slowly(right, {**study.base.values, **TILT})
    )
    assert 0.0 < 1.3 * once < slowly


def test_each_block_counts_alike():
    assert explained_slowly(np.array([8.0, 1.0]), np.array([1.0, 1.0])) == pytest.approx(np.log(8.0) / 2.0)
    assert explained_slowly(np.array([1.0, 1.0]), np.array([8.0, 1.0])) == pytest.approx(-np.log(8.0) / 2.0)
    assert np.isfinite(explained_slowly(np.zeros(2), np.zeros(2)))


def test_only_what_is_forgotten_differs(hung, studied):
    study = studied(hung)
    observer = study.misfit.observer.forgetting(SLOW)
    made = Observer(study.observation, study.plain.at(study.base.values), SLOW)
    assert study.misfit.observer.patience != SLOW
    world = study.plain.at(study.base.values)
    first, second = (one.lead(world).predicted for one in (observer, made))
    np.testing.assert_array_equal(first.numpy(), second.numpy())
