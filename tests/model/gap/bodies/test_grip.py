"""A hand carries what it holds: rigidly where its controllers tell a turn, by its shift alone otherwise."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from model.gap.bodies.grip import held_places, idle_hands

APART = 0.05
HAND = np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.0], [0.0, 0.03, 0.0]])
HELD = np.array([[0.01, 0.01, 0.0], [0.02, -0.01, 0.01], [0.0, 0.04, -0.02]])
TURN = Rotation.from_rotvec([0.4, -0.7, 1.1])
WAY = np.array([0.2, -0.1, 0.3])


def moved(places):
    return TURN.apply(places) + WAY


def test_three_controllers_carry_a_turn_exactly():
    found = held_places(np.stack([HAND, moved(HAND)]), HELD, APART)
    np.testing.assert_allclose(found[1], moved(HELD), atol=1e-9)


def test_the_first_frame_is_as_given():
    found = held_places(np.stack([HAND, moved(HAND)]).astype(np.float32), HELD, APART)
    np.testing.assert_allclose(found[0], HELD, atol=1e-7)


def test_two_hands_keep_apart():
    """The first turns, the second only shifts; each point goes with the hand that it is nearest to."""
    far = np.array([1.0, 0.0, 0.0])
    hands = np.stack([np.concatenate([HAND, HAND + far]), np.concatenate([moved(HAND), HAND + far - WAY])])
    found = held_places(hands, np.concatenate([HELD, HELD + far]), APART)
    np.testing.assert_allclose(found[1, :3], moved(HELD), atol=1e-9)
    np.testing.assert_allclose(found[1, 3:], HELD + far - WAY, atol=1e-9)


def test_a_hand_larger_than_the_gap_between_its_controllers_is_one():
    """Controllers in a chain, each near the next, belong together."""
    hand = np.array([[0.04 * i, 0.01 * (i % 2), 0.0] for i in range(6)])
    found = held_places(np.stack([hand, moved(hand)]), HELD, APART)
    np.testing.assert_allclose(found[1], moved(HELD), atol=1e-9)


def test_one_controller_only_shifts():
    found = held_places(np.stack([HAND[:1], HAND[:1] + WAY]), HELD, APART)
    np.testing.assert_allclose(found[1], HELD + WAY, atol=1e-9)


@pytest.mark.parametrize("count", [2, 4])
def test_controllers_in_a_line_tell_no_turn(count):
    """About their own axis they would turn at random: what is held between them goes with their middle."""
    line = np.linspace(0.0, 1.0, count)[:, None] * [0.03, 0.0, 0.0]
    found = held_places(np.stack([line, moved(line)]), line.mean(0)[None], APART)
    np.testing.assert_allclose(found[1, 0], moved(line.mean(0)), atol=1e-9)
    beside = np.array([[0.015, 0.02, 0.0]])
    shifted = held_places(np.stack([line, line + WAY]), beside, APART)
    np.testing.assert_allclose(shifted[1], beside + WAY, atol=1e-9)


def test_a_hand_that_opens_takes_what_is_near_each_finger_with_it():
    opened = HAND.copy()
    opened[1, 0] += 0.02
    found = held_places(np.stack([HAND, opened]), np.array([[0.03, 0.0, 0.0], [0.0, 0.0, 0.0]]), APART)
    np.testing.assert_allclose(found[1], opened[[1, 0]], atol=1.5e-3)


def test_a_hand_that_holds_nothing_is_idle():
    far = np.array([1.0, 0.0, 0.0])
    hands = np.concatenate([HAND + far, HAND])
    (idle,) = idle_hands(hands, HELD, APART)
    np.testing.assert_array_equal(idle, [0, 1, 2])
    assert not idle_hands(hands, np.concatenate([HELD, HELD + far]), APART)
    assert [len(own) for own in idle_hands(hands, np.zeros((0, 3)), APART)] == [3, 3]


SMALL = 0.01 * np.array([[1.0, 0.0, 0.0], [-1.0, 0.3, 0.0], [0.0, -0.8, 0.5], [0.2, 0.5, -0.5]])
"""Four controllers within two centimetres [m]."""
BESIDE = np.array([[0.03, 0.0, 0.0], [0.0, 0.0, 0.03]])


@pytest.mark.parametrize("seed", range(8))
def test_the_noise_of_a_small_hand_does_not_turn_what_it_holds(noisy, seed):
    way = np.linspace(0.0, 1.0, 60)[:, None, None] * WAY
    found = held_places(noisy(SMALL + way, 0.0015, 0.9, seed), BESIDE, APART)
    off = np.linalg.norm(found - BESIDE - way, axis=-1)
    # two errors of a mean of four; a turn that is fitted to them is off by about a centimetre
    assert np.sqrt((off**2).mean()) < 2.5 * np.sqrt(3.0 * 2.0 / 4.0) * 0.0015


@pytest.mark.parametrize("seed", range(8))
def test_a_small_hand_that_turns_is_followed_for_all_its_noise(noisy, seed):
    turns = Rotation.from_rotvec(np.linspace(0.0, 1.2, 60)[:, None] * [0.3, 0.5, 0.8])
    turned = np.stack([turns.apply(each) for each in SMALL], axis=1)
    there = np.stack([turns.apply(each) for each in BESIDE], axis=1)
    found = held_places(noisy(turned, 0.0007, 0.9, seed), BESIDE, APART)
    away = np.linalg.norm(found[-1] - BESIDE, axis=-1)
    assert (np.linalg.norm(found[-1] - there[-1], axis=-1) < 0.35 * away).all()


def test_fingers_that_spread_are_no_noise():
    """They move by more than anybody who measures a hand errs: what is near one of them goes with it."""
    spread = np.stack([HAND, HAND * 3.0])
    found = held_places(spread, HAND[1:2], APART)
    assert np.linalg.norm(found[1, 0] - HAND[1]) > 0.02
