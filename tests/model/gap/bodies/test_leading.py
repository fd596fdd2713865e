"""Hands that lead what is seen of an object, and hands that are near it by chance."""

import numpy as np
import pytest

from model.gap.bodies.body import body_of
from model.gap.bodies.leading import leads
from model.types import Observation

GAP, SEEN = 0.12, 0.4
T = np.arange(60) / 30.0


def path(size):
    """Up, and to and fro [T, 3]."""
    return size * np.stack([np.sin(4 * T), 0 * T, 1 - np.cos(2 * T)], -1)


def recording(hand, rope, hidden=GAP):
    """A rope of which the end in the hand is not seen, the hand beyond it, and what each of them does."""
    s = np.linspace(0.0, SEEN, 60)
    line = np.stack([s, 0.04 * np.sin(np.pi * s / SEEN), 0 * s], -1)
    grip = np.array([-hidden, 0.0, 0.0]) + 0.004 * np.random.default_rng(0).normal(size=(5, 3))
    return Observation(
        times=T,
        points=(line + rope[:, None]).astype(np.float32),
        controllers=(grip + hand[:, None]).astype(np.float32),
    )


def reach(seen):
    return body_of(seen, "rope").points[:, 0].min()


def test_a_rope_goes_on_to_the_hand_that_leads_it_however_much_of_it_is_hidden():
    body = body_of(recording(path(0.15), path(0.15)), "rope")
    assert body.points[:, 0].min() == pytest.approx(-GAP, abs=0.005)
    assert len(set(body.grip[:, 0])) == 5
    assert np.diff(np.sort(body.points[:, 0])).max() < 1.5 * body.spacing


@pytest.mark.parametrize(
    "hand",
    [np.roll(path(0.15), 30, axis=0), -path(0.15), path(0.5)],
    ids=["goes later", "goes the other way", "goes farther"],
)
def test_it_does_not_go_to_one_that_moves_by_itself(hand):
    seen = recording(hand - hand[0], path(0.15))
    assert reach(seen) > -0.01
    assert not len(body_of(seen, "rope").grip)


def test_where_nothing_moves_nothing_is_told():
    assert reach(recording(path(0.0), path(0.0))) > -0.01


def test_a_hand_that_holds_still_leads_what_swings_about_it():
    """Half a circle about the hand, at the end of what is hidden."""
    angle = np.pi * T / T[-1]
    arm = GAP * np.stack([np.cos(angle), 0 * T, np.sin(angle)], -1)
    assert leads(np.zeros((60, 3)), arm[:, None], GAP)
    assert not leads(np.zeros((60, 3)), (arm * np.linspace(1, 2, 60)[:, None])[:, None], GAP)


def test_what_a_track_loses_now_and_then_does_not_matter():
    hand = path(0.15)
    points = hand[:, None] + np.array([[GAP, 0.0, 0.0], [GAP, 0.01, 0.0]])
    points[5:20, 0] = np.nan
    points[30, 1] += 1.0
    assert leads(hand, points, GAP)
    points[:, :] = np.nan
    assert not leads(hand, points, GAP)


def test_farther_than_most_of_what_is_seen_nothing_is_led():
    assert reach(recording(path(0.3), path(0.3), hidden=0.7 * SEEN)) > -0.01
