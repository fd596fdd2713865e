import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from model.scenes.grasp import hand_groups, hands_of, touching
from model.views import look_at

CAMERA = look_at(np.array([0.0, -0.6, 0.4]), np.array([0.0, 0.0, 0.05]), 200.0, 160, 120)


@pytest.fixture(scope="module")
def ball():
    """A ball of 6 cm on a table: points and normals."""
    normals = np.random.default_rng(0).normal(size=(1500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return (0.06 * normals + [0, 0, 0.06]).astype(np.float32), normals.astype(np.float32)


@pytest.fixture(scope="module")
def hands(ball):
    """Two of them, one on each side, that lift and turn."""
    left, right = np.array([-0.06, 0.0, 0.06]), np.array([0.06, 0.0, 0.06])
    fingers = 0.012 * np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0.3, -1]])
    turns = Rotation.from_rotvec(np.outer(np.linspace(0, 0.8, 5), [0, 0, 1])).as_matrix()
    rise = np.outer(np.linspace(0, 0.1, 5), [0, 0, 1])
    moved = [np.einsum("tij,cj->tci", turns, fingers) + side + rise[:, None] for side in (left, right)]
    controllers = np.concatenate(moved, axis=1).astype(np.float32)
    return controllers, hands_of(controllers, *ball, CAMERA, np.random.default_rng(0), 0.006)


def test_fingers_that_keep_their_distances_are_one_hand(hands):
    controllers, _ = hands
    np.testing.assert_array_equal(hand_groups(controllers), [0] * 4 + [1] * 4)
    np.testing.assert_array_equal(hand_groups(controllers[:, :1]), [0])
    # Near each other, but one goes its own way.
    two = controllers[:, :2].copy()
    two[:, 1, 0] += np.linspace(0, 0.03, 5).astype(np.float32)
    np.testing.assert_array_equal(hand_groups(two), [0, 1])


def test_each_hand_touches_what_it_holds_and_stays_outside(ball, hands):
    surface, normals = ball
    for hand in hands[1]:
        means = hand.at(0)[0]
        distance, index = cKDTree(surface).query(means)
        assert distance.min() < 0.008
        depth = ((means - surface[index]) * normals[index]).sum(axis=1)
        assert np.quantile(depth[distance < 0.03], 0.02) > -0.02
        assert np.linalg.norm(means, axis=1).max() > 0.5  # with its arm
        assert means[:, 2].min() > -0.03


def test_a_left_and_a_right_hand_do_not_share_a_place(hands):
    one, other = (hand.at(0)[0] for hand in hands[1])
    palms = [means[np.linalg.norm(means - means[0], axis=1) < 0.1] for means in (one, other)]
    assert cKDTree(palms[0]).query(palms[1])[0].min() > 0.01


def test_hands_go_where_their_controllers_go(hands):
    controllers, placed = hands
    for number, hand in enumerate(placed):
        held = controllers[:, 4 * number : 4 * number + 4].astype(np.float64)
        first, last = (hand.at(frame)[0].astype(np.float64) for frame in (0, 4))
        away = [cKDTree(means).query(points)[0] for means, points in ((first, held[0]), (last, held[4]))]
        np.testing.assert_allclose(away[0], away[1], atol=1e-4)
        turned = hand.at(4)[2] @ Rotation.from_rotvec([0, 0, 0.8]).as_matrix()
        np.testing.assert_allclose(turned, hand.at(0)[2], atol=1e-4)


def test_people_differ_in_skin_and_sleeves(ball):
    still = np.tile(np.array([[[0.0, 0.0, 0.12]]], np.float32), (2, 1, 1))
    arms = []
    for seed in range(6):
        (hand,) = hands_of(still, *ball, CAMERA, np.random.default_rng(seed), 0.008)
        coat = hand.coat.gaussians
        away = np.linalg.norm(coat.means - np.array([0.0, 0.0, 0.12]), axis=1)
        arms.append([coat.colors[part].mean(axis=0) for part in (away < 0.25, away > 0.5)])
    skin, sleeve = np.moveaxis(np.array(arms), 1, 0)
    assert (skin[:, 0] > skin[:, 2]).all()
    assert np.ptp(skin.mean(axis=1)) > 0.1
    bare = np.abs(sleeve / sleeve.sum(axis=1, keepdims=True) - skin / skin.sum(axis=1, keepdims=True)).max(
        axis=1
    )
    assert (bare < 0.03).any()
    assert (bare > 0.05).any()


def test_nobody_is_there_where_nothing_is_held(ball):
    nothing = np.zeros((5, 0, 3), np.float32)
    assert hands_of(nothing, *ball, CAMERA, np.random.default_rng(0)) == []


def test_a_grip_is_moved_to_the_surface(ball):
    top = np.array([0.0, 0.0, 0.12])
    for height in (-0.05, -0.002, 0.03):
        moved = touching(top + np.array([0, 0, height]), *ball)
        assert np.linalg.norm(moved - [0, 0, 0.06]) == pytest.approx(
            0.06 + np.clip(height, -0.008, 0.004), abs=1e-3
        )
