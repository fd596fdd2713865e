import numpy as np
import torch

from model.gap.bodies.hold import Hold

HAND = np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.0], [0.0, 0.03, 0.0]])
HELD = np.array([[0.01, 0.01, 0.0], [0.02, -0.01, 0.01], [0.0, 0.04, -0.02]])
APART = 0.1
FAR = np.array([1.0, 0.0, 0.0])


def cloud() -> np.ndarray:
    """Points within two hands."""
    rng = np.random.default_rng(0)
    return np.concatenate([rng.uniform(-0.05, 0.05, (8, 3)), FAR + rng.uniform(-0.05, 0.05, (5, 3))])


def test_each_hand_holds_what_is_nearest_to_it_fully():
    """However far that is; what is farther counts as by a bell about the controllers."""
    held = np.array([[0.004, 0.0, 0.0], [0.0, 0.005, 0.0], [1.0, 0.013, 0.0]])
    hold = Hold.of(np.stack([np.zeros(3), FAR]), held, APART)
    np.testing.assert_allclose(hold.square(), [0.0, 9e-6, 0.0], atol=1e-15)
    np.testing.assert_array_equal(hold.hands, [0, 0, 1])


def test_each_held_point_goes_with_the_nearest_hand():
    """Hands are counted from 0, also where only one of them holds anything."""
    hands = np.concatenate([HAND, HAND + FAR])
    assert Hold.of(hands, np.concatenate([HELD, HELD + FAR]), APART).hands.tolist() == [0, 0, 0, 1, 1, 1]
    assert Hold.of(hands, HELD + FAR, APART).hands.tolist() == [0, 0, 0]


def test_what_nobody_holds_is_at_no_distance():
    assert Hold.of(HAND, np.zeros((0, 3)), APART).square().shape == (0,)
    assert Hold.of(np.zeros((0, 3)), np.zeros((0, 3)), APART).square().shape == (0,)


def test_to_move_where_a_hand_holds_is_to_move_its_controllers():
    """Each hand by itself, the other one holds as before; many at once as one by one."""
    hands, points = np.concatenate([HAND, FAR + HAND]), cloud()
    hold = Hold.of(hands, points, APART)
    first, second = np.array([0.01, -0.005, 0.02]), np.array([-0.01, 0.0, 0.003])
    moved = torch.from_numpy(np.stack([[first, 0.0 * second], [0.0 * first, second], [first, second]]))
    found = hold.square(moved)
    assert found.shape == (3, len(points))
    for each, (one, two) in zip(found, moved.numpy(), strict=True):
        there = Hold.of(np.concatenate([HAND + one, FAR + HAND + two]), points, APART)
        np.testing.assert_allclose(each, there.square(), atol=1e-12)
    assert (found[0] - hold.square()).abs().max() > 1e-4


def test_a_point_goes_with_the_hand_that_was_nearest_wherever_that_holds():
    """A hand that is moved towards what another one holds does not take it over."""
    near = np.array([0.2, 0.0, 0.0])
    hold = Hold.of(np.stack([np.zeros(3), near]), np.array([[0.09, 0.0, 0.0], [0.0, 0.0, 0.0]]), APART)
    moved = torch.tensor([[0.0, 0.0, 0.0], [-0.1, 0.0, 0.0]], dtype=torch.float64)
    np.testing.assert_allclose(hold.square(moved), [0.09**2, 0.0], atol=1e-12)
