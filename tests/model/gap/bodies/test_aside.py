"""Places on the skin of a rope go along with its line."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from model.gap.bodies.aside import Aside
from model.gap.bodies.body import between

COUNT, RADIUS = 41, 0.01


def arc(bend, length=0.8, count=COUNT):
    """A line in the x-z plane that begins in the origin along x, bent by so much in all [rad]."""
    angle = np.linspace(0.0, bend, count)
    step = length / (count - 1)
    middle = 0.5 * (angle[1:] + angle[:-1])
    steps = step * np.stack([np.cos(middle), np.zeros(count - 1), np.sin(middle)], 1)
    return np.concatenate([np.zeros((1, 3)), steps.cumsum(0)]), angle


def skin(bend, rng, count=90):
    """The line, places around it, and how far along and around they are."""
    line, angle = arc(bend)
    at, around = rng.uniform(3, COUNT - 4, count), rng.uniform(0, 2 * np.pi, count)
    return line, on_skin(line, angle, at, around), at, around


def on_skin(line, angle, at, around):
    """Exact places on a bent tube that is not twisted."""
    numbers = np.arange(COUNT)
    bent = np.interp(at, numbers, angle)
    middle = np.stack([np.interp(at, numbers, line[:, axis]) for axis in range(3)], 1)
    up = np.stack([-np.sin(bent), np.zeros(len(at)), np.cos(bent)], 1)
    side = np.array([0.0, 1.0, 0.0])
    return middle + RADIUS * (np.cos(around)[:, None] * up + np.sin(around)[:, None] * side)


def seen_with(aside, line, index, weight):
    return (weight[..., None] * line[index]).sum(1) + aside.turned(line)


@pytest.mark.parametrize("bend", [0.0, 1.0, -2.0])
def test_in_its_own_pose_a_place_is_where_it_was_seen(bend):
    line, seen, _, _ = skin(bend, np.random.default_rng(0))
    index, weight = between(seen, line)
    np.testing.assert_allclose(
        seen_with(Aside.of(seen, line, index, weight), line, index, weight), seen, atol=1e-12
    )


@pytest.mark.parametrize("bend", [0.5, 1.5, -3.0])
def test_a_straight_rope_that_bends_takes_its_skin_along(bend):
    line, seen, at, around = skin(0.0, np.random.default_rng(1))
    index, weight = between(seen, line)
    bent, angle = arc(bend)
    made = seen_with(Aside.of(seen, line, index, weight), bent, index, weight)
    # lines of straight pieces cut corners, and weights of six points smooth them
    np.testing.assert_allclose(made, on_skin(bent, angle, at, around), atol=3e-4 * max(1.0, abs(bend)))
    ignored = (weight[..., None] * bent[index]).sum(1) + seen - (weight[..., None] * line[index]).sum(1)
    assert np.abs(ignored - on_skin(bent, angle, at, around)).max() > 0.3 * RADIUS * min(1.0, abs(bend))


@settings(max_examples=30)
@given(st.integers(0, 10**6))
def test_rolled_and_turned_together_is_turned_as_a_whole(seed):
    rng = np.random.default_rng(seed)
    line, seen, _, _ = skin(float(rng.uniform(-2, 2)), rng, 40)
    index, weight = between(seen, line)
    turn = Rotation.random(random_state=seed).as_matrix()
    turned = Aside.of(seen, line, index, weight).rolled(turn)
    np.testing.assert_allclose(seen_with(turned, line @ turn.T, index, weight), seen @ turn.T, atol=1e-10)


def test_what_is_not_seen_is_nowhere_aside_and_a_rope_turned_round_has_no_least_turn_but_stays_finite():
    line, seen, _, _ = skin(0.0, np.random.default_rng(2))
    seen[3] = np.nan
    index, weight = between(seen, line)
    aside = Aside.of(seen, line, index, weight)
    assert (aside.offset[3] == 0.0).all()
    back = aside.turned(line * np.array([-1.0, 1.0, 1.0]))
    assert np.isfinite(back).all()
    assert np.linalg.norm(back, axis=1).max() <= 1.01 * np.linalg.norm(aside.offset, axis=1).max()


def test_a_rope_lies_as_far_above_the_ground_as_its_skin_is_from_its_middle():
    line, seen, _, _ = skin(0.0, np.random.default_rng(3))
    aside = Aside.of(seen, line, *between(seen, line))
    assert aside.height(line, None) == 0.0
    assert aside.height(line, -1.0) == pytest.approx(RADIUS, rel=0.1)
    assert aside.height(line, -0.004) == pytest.approx(0.004), "no higher than it is seen to be"
    assert aside.height(line, 0.002) == 0.0


def folded():
    """Half of a straight rope turned back over the other half, a hair aside, and its angle at each point."""
    angle = np.concatenate([np.zeros(14), np.linspace(0.0, np.pi, 13), np.full(COUNT - 27, np.pi)])
    middle = 0.5 * (angle[1:] + angle[:-1])
    way = np.stack([np.cos(middle), 1e-3 * np.sin(40 * middle), np.sin(middle)], 1)
    return np.concatenate([np.zeros((1, 3)), 0.8 / (COUNT - 1) * way.cumsum(0)]), angle


def test_a_rope_that_is_folded_over_keeps_its_skin_on_the_side_that_it_is_on():
    """Of what is turned round the least turn is about any axis, and would lead the skin to any side."""
    line, seen, at, around = skin(0.0, np.random.default_rng(4))
    index, weight = between(seen, line)
    bent, angle = folded()
    made = seen_with(Aside.of(seen, line, index, weight), bent, index, weight)
    # of six points of a narrow bend the mean is a little inside
    np.testing.assert_allclose(made, on_skin(bent, angle, at, around), atol=0.25 * RADIUS)


def test_what_lies_as_it_did_says_how_a_folded_rope_is_rolled():
    line, seen, at, _ = skin(0.0, np.random.default_rng(5))
    aside = Aside.of(seen, line, *between(seen, line))
    lean = Rotation.from_rotvec([0.4, 0.0, 0.0]).as_matrix()
    found = aside.turned(folded()[0] @ lean.T)
    np.testing.assert_allclose(found[at < 12], aside.offset[at < 12], atol=0.1 * RADIUS)
