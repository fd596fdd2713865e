"""Whether an object touches itself is told from what was seen."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.meeting import EVERY, able_effects, may_meet


@pytest.fixture
def rope(short, studied):
    """A function: a study of the rope, some points of which are elsewhere in some frames."""
    study = studied(short)

    def seen(change, frames=(2 * EVERY,)):
        points = short.points.copy()
        for frame in frames:
            change(points[frame])
        return replace(study, observation=replace(short, points=points))

    return seen


def fold(points):
    """The lower half lies on the upper one."""
    points[4:] = points[3::-1]


def test_a_rope_that_hangs_does_not(rope):
    assert not may_meet(rope(lambda points: None))


def test_a_rope_that_is_folded_onto_itself_does(rope):
    assert may_meet(rope(fold))


def test_near_is_less_than_a_spacing(rope):
    def fold_beside(points):
        fold(points)
        points[4:, 1] += 0.03

    assert not may_meet(rope(fold_beside))


def test_neighbours_that_come_together_do_not_count(rope):
    def shrink(points):
        points[:] = points[3] + 0.3 * (points - points[3])
        points[1:] = points[1:] + np.arange(7)[:, None] * [0.0, 0.02, 0.0]

    def pairs(points):
        points[1::2] = points[::2]

    assert not may_meet(rope(shrink))
    assert not may_meet(rope(pairs))


def test_one_pair_may_be_a_wrong_track(rope):
    def strayed(points):
        points[7] = points[0]

    assert not may_meet(rope(strayed))


def test_points_that_are_not_seen_meet_nothing(rope):
    def hidden(points):
        fold(points)
        points[5:] = np.nan

    assert not may_meet(rope(hidden))


def test_a_rope_has_bends_that_yield_and_no_faces(short, studied):
    known = {effect.name: set(effect.quantities) for effect in able_effects(studied(short))}
    assert {"yield_curvature", "bending_stiffness"} < known["plasticity"]
    assert "facing" not in known["wind"] | known["quadratic_air_drag"]
