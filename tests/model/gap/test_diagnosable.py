"""What is refused before anything is fitted, in a line that names the key; what is healthy is let through."""

from dataclasses import replace

import numpy as np
import pytest

from model.errors import InputError
from model.gap.diagnosable import check_diagnosable, check_moves, check_transfer
from model.types import Observation

FRAMES = 20


@pytest.fixture
def seen() -> Observation:
    """A sheet of 5 × 6 points that a hand holds at one corner and swings."""
    u, v = np.meshgrid(np.linspace(0, 0.4, 5), np.linspace(0, 0.5, 6), indexing="ij")
    places = np.stack([u, 0 * u, 1.0 - v], -1).reshape(-1, 3)
    places = places + np.random.default_rng(0).normal(0, 0.01, places.shape)
    times = np.arange(FRAMES) / 30
    swing = np.stack([0.1 * np.sin(5 * times), 0 * times, 0 * times], -1)[:, None]
    return Observation(
        times=times,
        points=(places + swing).astype(np.float32),
        controllers=(places[:1] + swing).astype(np.float32),
        ground_height=0.2,
    )


def sparse(seen: Observation, **where: slice) -> Observation:
    """Seen in some frames or at some points only."""
    points = np.full_like(seen.points, np.nan)
    kept = where.get("frames", slice(None)), where.get("points", slice(None))
    points[kept] = seen.points[kept]
    return replace(seen, points=points)


def lying(seen: Observation) -> Observation:
    """On the ground, with nothing that holds it."""
    return replace(seen, ground_height=0.5, controllers=seen.controllers[:, :0])


def still(places):
    """Where they were first, measured with 1 mm of noise."""
    noise = np.random.default_rng(2).normal(0, 1e-3, places.shape)
    return (places[:1] + noise).astype(np.float32)


def rarely(seen: Observation):
    """Every fourth frame."""
    return (np.arange(len(seen.times)) % 4 == 3)[:, None, None]


def test_what_is_healthy_is_let_through(seen):
    for one in (
        seen,
        replace(seen, ground_height=None),
        replace(seen, gravity=(0.0, 0.0, 0.0), controllers=seen.controllers[:, :0]),
        lying(seen),
        replace(seen, gravity=(3.0, 0.0, -9.3)),
        sparse(seen, points=slice(0, 3)),
        sparse(seen, frames=slice(2, 17)),
        # frames that were lost, at another rate from the middle on
        replace(seen, times=np.where(np.arange(FRAMES) < 9, seen.times, seen.times + 0.15)),
        replace(seen, times=np.cumsum(np.where(np.arange(FRAMES) < 16, 0.03, 0.25))),
        # a ground that is measured a little too high
        replace(seen, ground_height=float(np.median(seen.points[..., 2])) + 0.05),
    ):
        check_diagnosable(one, "o.npz")


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (
            lambda o: replace(o, times=o.times[:11], points=o.points[:11], controllers=o.controllers[:11]),
            "times: expected at least 12 frames to diagnose, found 11",
        ),
        (lambda o: replace(o, times=np.arange(FRAMES) * 1.0), "times: expected at most 0.2 s between frames"),
        (
            lambda o: replace(o, times=0.01 * o.times),
            "times: expected at least 0.3 s to diagnose, found 0.00633",
        ),
        (
            lambda o: replace(o, times=o.times + 20.0 * (np.arange(FRAMES) > 6)),
            "times: expected frames about 0.0333 s apart, found a pause from 0.2 to 20.2333 s: "
            "give the longest part alone, from 20.2333 to 20.6333 s",
        ),
        (
            lambda o: sparse(o, points=slice(0, 1)),
            "points: expected at least 3 that are seen to diagnose, found 1",
        ),
        (
            lambda o: sparse(o, points=slice(0, 2)),
            "points: expected at least 3 that are seen to diagnose, found 2",
        ),
        (lambda o: sparse(o, frames=slice(0, 11)), "seen in at least 12 frames to diagnose, found 11 such"),
        (lambda o: replace(o, gravity=(0.0, 0.0, 9.81)), "gravity: expected it to point down, found 9.81"),
        (
            lambda o: replace(o, gravity=(0.0, -9.81, 0.0), ground_height=0.0),
            "gravity: expected it to point down onto the ground of constant z, found (0.0, -9.81, 0.0)",
        ),
        (
            lambda o: replace(o, ground_height=2.0),
            "ground_height: expected a ground under the object, found 2 m",
        ),
        (
            lambda o: replace(o, points=np.where(rarely(o), np.float32(0.0), o.points)),
            "points: expected places, found 30 that jump to (0, 0, 0) (25 % of all that is seen): write NaN",
        ),
        (
            lambda o: replace(o, controllers=np.where(rarely(o), np.float32(0.0), o.controllers)),
            "controllers: expected places, found 1 that jump to (0, 0, 0)",
        ),
        (
            lambda o: replace(o, points=np.repeat(o.points[:1], FRAMES, 0), controllers=o.controllers[:, :0]),
            "controllers: expected the hand that holds the object",
        ),
        (
            lambda o: replace(
                o, points=np.repeat(o.points[:1], FRAMES, 0), controllers=o.controllers + np.float32(2.0)
            ),
            "controllers: expected the hand that holds the object",
        ),
    ],
)
def test_what_says_too_little_is_refused_in_one_line(seen, change, line):
    with pytest.raises(InputError) as caught:
        check_diagnosable(change(seen), "o.npz")
    assert str(caught.value).startswith("o.npz: ")
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_moves_a_little_or_begins_at_the_origin_is_let_through(seen):
    """A hand may be where the world begins; it does not jump there."""
    origin = replace(
        seen, points=seen.points - seen.controllers[0], controllers=seen.controllers - seen.controllers[0]
    )
    lower = replace(origin, ground_height=-1.5)
    check_diagnosable(lower, "o.npz")
    calm = replace(seen, points=still(seen.points), controllers=seen.controllers)
    check_moves(calm, "o.npz")


def test_what_does_not_move_is_refused(seen):
    rest = replace(seen, points=still(seen.points), controllers=still(seen.controllers))
    with pytest.raises(InputError, match=r"^o\.npz: points: expected an object that moves, found all within"):
        check_moves(rest, "o.npz")


def test_measured_twice_is_not_the_same_motion(seen):
    noise = np.random.default_rng(3).normal(0, 2e-3, (2, *seen.points.shape)).astype(np.float32)
    first, again = (replace(seen, points=seen.points + one) for one in noise)
    check_transfer(first, again, "other.npz")


def test_another_interaction_with_the_object_is_let_through(seen):
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    stretched = seen.points * np.array([1.6, 1.0, 0.7]) @ turn.T + np.array([1.0, -2.0, 0.3])
    hidden = stretched.astype(np.float32)
    hidden[:, 4:9] = np.nan
    check_transfer(seen, replace(seen, points=hidden), "other.npz")
    others = np.full_like(seen.points, np.nan)
    others[:, :3] = seen.points[:, :3]
    moved = seen.controllers + np.float32(0.02)
    check_transfer(
        sparse(seen, points=slice(5, None)), replace(seen, points=others, controllers=moved), "other.npz"
    )


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda points: points[:, :-1], "found the same motion again"),
        (lambda points: points, "found the same motion again, which confirms nothing"),
        (lambda points: points[::-1], "found the same motion again"),
        (lambda points: np.round(points, 5), "found the same motion again"),
        (
            lambda points: points[:, np.random.default_rng(1).permutation(points.shape[1])],
            "found the same motion again",
        ),
        (
            lambda points: np.where((np.arange(FRAMES) < 9)[:, None, None], 1.2 * points, np.nan),
            "seen in at least 3 of the frames from 0.3 s on, which a twin foretells, found 0 such frames",
        ),
        (
            lambda points: np.where(np.isin(np.arange(FRAMES), range(1, 12))[:, None, None], np.nan, points),
            "seen in at least 2 of the frames before 0.3 s, to which a twin is fitted, found 1 such frames",
        ),
    ],
)
def test_another_recording_that_confirms_nothing_is_refused(seen, change, line):
    hidden = seen.points.copy()
    hidden[3:6, 2] = np.nan
    first = replace(seen, points=hidden)
    with pytest.raises(InputError) as caught:
        check_transfer(first, replace(first, points=change(hidden)), "other.npz")
    assert str(caught.value).startswith("other.npz: ")
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)


def test_other_points_that_another_hand_moves_are_let_through(seen):
    turned = seen.controllers[:, :, [1, 0, 2]] + np.float32(0.1)
    check_transfer(seen, replace(seen, points=seen.points[:, :-1], controllers=turned), "other.npz")
    unheld = replace(seen, points=seen.points[:, :-1], controllers=seen.controllers[:, :0])
    check_transfer(seen, unheld, "other.npz")


@pytest.mark.parametrize("part", [slice(1, None), slice(0, None, 2)], ids=["less a frame", "every other"])
def test_a_part_of_the_first_recording_confirms_nothing(seen, part):
    other = replace(
        seen, times=seen.times[part], points=seen.points[part], controllers=seen.controllers[part]
    )
    with pytest.raises(InputError, match="found the same motion again"):
        check_transfer(seen, other, "other.npz")
