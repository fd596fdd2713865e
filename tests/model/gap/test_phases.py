"""Phases are found in motions of which they are known."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from model.gap.phases import MOST, SHORTEST, phases
from model.types import Observation

FPS = 30.0
GRID = 0.03 * np.stack(np.meshgrid(*3 * [np.arange(4.0)], indexing="ij"), -1).reshape(-1, 3)


def moved(height, stretch=None, hand=None, noise=0.0):
    """A cube at `height` above the ground, longer by `stretch`; without a hand it is held by its top."""
    stretch = np.ones(len(height)) if stretch is None else stretch
    points = GRID[None] * np.stack([stretch, 0 * stretch + 1, 0 * stretch + 1], -1)[:, None]
    points[..., 2] += height[:, None]
    points += np.random.default_rng(2).normal(0, 1, points.shape) * noise
    tops = points[:, GRID[:, 2] == GRID[:, 2].max()][:, -4:] if hand is None else hand
    return Observation(
        times=np.arange(len(height)) / FPS,
        points=points.astype(np.float32),
        controllers=tops.astype(np.float32),
        ground_height=0.0,
    )


def lift_hold_release():
    """0.5 s on the ground, 0.7 s up by 0.42 m, 0.6 s held, let go and fallen for 0.29 s, then it lies."""
    times = np.arange(90) / FPS
    height = np.interp(times, [0.5, 1.2], [0.0, 0.42])
    fallen = np.clip(times - 1.8, 0, None)
    hand = GRID[-4:][None] + height[:, None, None] * [0.0, 0.0, 1.0]
    hand = hand + np.clip(times - 1.8, 0, None)[:, None, None] * [0.0, 0.0, 1.0]
    return moved(np.maximum(height - 0.5 * 9.81 * fallen**2, 0.0), hand=hand, noise=1e-3)


def test_lift_hold_release():
    found = phases(lift_hold_release())
    names = [phase.name for phase in found]
    assert names[0] == "held still, touching the ground"
    assert names[-1] == "lying on the ground"
    starts = {phase.name: phase.start_s for phase in found}
    assert starts["lifted"] == pytest.approx(0.5, abs=0.15)
    assert starts["held still"] == pytest.approx(1.2, abs=0.1)
    assert starts["free"] == pytest.approx(1.8, abs=0.2)
    order = ["lifted", "held still", "free", "lying on the ground"]
    assert [name for name in names if name in order] == order


def test_they_divide_the_time():
    seen = lift_hold_release()
    found = phases(seen)
    assert found[0].first == 0
    assert found[-1].end == len(seen.times)
    assert (found[0].start_s, found[-1].end_s) == (seen.times[0], seen.times[-1])
    for before, after in pairwise(found):
        assert before.end == after.first
        assert before.end_s == after.start_s
        assert before.name != after.name
    assert min(phase.end_s - phase.start_s for phase in found) >= SHORTEST - 1e-9


def test_stretched_held_and_let_back():
    stretch = 1 + np.interp(np.arange(90), [10, 35, 60, 80], [0, 0.5, 0.5, 0])
    seen = moved(np.full(90, 0.5), stretch, noise=1e-3)
    assert [phase.name for phase in phases(seen)] == [
        "held still",
        "stretched",
        "held still",
        "let back",
        "held still",
    ]


def test_a_turn_about_the_vertical_and_other_points_first_change_nothing():
    seen = lift_hold_release()
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]], np.float32)
    turned = replace(seen, points=seen.points[:, ::-1] @ turn.T, controllers=seen.controllers @ turn.T)
    assert phases(turned) == phases(seen)


def test_hidden_points_do_not_let_go():
    seen = moved(0.5 + np.interp(np.arange(60), [15, 45], [0, 0.4]), noise=1e-3)
    hidden = seen.points.copy()
    hidden[20:40, GRID[:, 2] > 0.05] = np.nan
    assert [p.name for p in phases(replace(seen, points=hidden))] == ["held still", "lifted", "held still"]


def test_a_shaken_hand_does_not_make_countless_phases():
    times = np.arange(300) / FPS
    found = phases(moved(0.5 + 0.1 * np.sin(2 * np.pi * 2.0 * times)))
    assert len(found) <= MOST


def test_without_hand_and_ground_it_is_free():
    seen = moved(np.full(20, 0.5))
    alone = replace(seen, controllers=seen.controllers[:, :0], ground_height=None)
    assert [phase.name for phase in phases(alone)] == ["free"]
    two = replace(alone, times=alone.times[:2], points=alone.points[:2], controllers=alone.controllers[:2])
    assert [(phase.first, phase.end) for phase in phases(two)] == [(0, 2)]


@pytest.mark.parametrize("frames", [slice(12, None), slice(None, 45)], ids=["to the end", "at first"])
def test_points_that_are_hidden_for_long_do_not_disturb(frames):
    """A cube is lifted: where a few of its points were last seen, or first, it neither stays nor is torn."""
    height = np.interp(np.arange(75) / FPS, [0.5, 1.8], [0.0, 0.4])
    whole = moved(height, noise=5e-4)
    points = whole.points.copy()
    points[frames, 4::16] = np.nan  # of its lowest layer
    found, expected = phases(replace(whole, points=points)), phases(whole)
    assert [phase.name for phase in expected] == ["held still, touching the ground", "lifted", "held still"]
    assert [phase.name for phase in found] == [phase.name for phase in expected]
    for one, other in zip(found, expected, strict=True):
        assert abs(one.start_s - other.start_s) <= 0.07
