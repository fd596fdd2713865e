"""What of a recording is diagnosed, and what is said of the rest."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from model.errors import InputError
from model.gap.bodies.body import body_of
from model.gap.schema import GapReport, PartShare, Where
from model.gap.taken import MOST, Taken
from model.types import Observation

FRAMES = 90


@pytest.fixture
def seen() -> Observation:
    """A sheet of 64 points that a hand holds at one corner and carries along, 5 mm in each frame."""
    u, v = np.meshgrid(np.linspace(0, 0.4, 8), np.linspace(0, 0.4, 8), indexing="ij")
    places = np.stack([u, 0 * u, 1.0 - v], -1).reshape(-1, 3)
    times = np.arange(FRAMES) / 30
    way = np.stack([0.005 * np.arange(FRAMES), 0 * times, 0 * times], -1)[:, None]
    noise = np.random.default_rng(0).normal(0, 0.001, (FRAMES, 64, 3))
    return Observation(
        times=times,
        points=(places + way + noise).astype(np.float32),
        controllers=(places[:1] + way).astype(np.float32),
    )


def blind(seen: Observation, *frames: slice) -> Observation:
    """Nothing is seen in some frames."""
    points = seen.points.copy()
    for some in frames:
        points[some] = np.nan
    return replace(seen, points=points)


def found(taken: Taken) -> GapReport:
    """A report on what was taken, the later frames and points having more of the gap."""
    frames, points = taken.observation.points.shape[:2]
    shares = [np.arange(1.0, count + 1) / np.arange(1.0, count + 1).sum() for count in (points, frames)]
    acts = tuple(np.linspace(0, 1, points).tolist())
    where = Where(points=tuple(shares[0].tolist()), frames=tuple(shares[1].tolist()), acts_on=acts)
    return GapReport.model_construct(where=where)


def test_what_is_seen_from_the_start_is_taken_whole(seen):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        taken = Taken.of(seen, "o.npz")
    assert taken.first == 0
    np.testing.assert_array_equal(taken.observation.points, seen.points)


@pytest.mark.parametrize("hands", [0, 1, 2])
def test_a_recording_begins_when_the_object_is_seen(seen, hands):
    """The body is built where it is seen at first, and the hand is where it is then."""
    held = np.repeat(seen.controllers, 2, axis=1)[:, :hands]
    ground = 0.55 if hands == 0 else None
    whole = replace(blind(seen, slice(0, 20)), controllers=held, ground_height=ground)
    points = whole.points.copy()
    points[20, 2:] = np.nan
    whole = replace(whole, points=points)
    with pytest.warns(
        UserWarning, match=r"^o\.npz: fewer than 3 points are seen in the first 21 frames: left"
    ):
        taken = Taken.of(whole, "o.npz")
    assert taken.first == 21
    assert taken.observation.times[0] == whole.times[21]
    assert len(taken.observation.controllers) == len(taken.observation.points) == FRAMES - 21
    body = body_of(taken.observation)
    np.testing.assert_allclose(body.points.mean(0), seen.points[21].mean(0), atol=0.01)
    assert set(body.grip[:, 0]) == set(range(hands))


def test_what_is_judged_is_seen(seen):
    with pytest.warns(
        UserWarning, match=r"^o\.npz: fewer than 3 points are seen in the last 27 frames: left"
    ):
        taken = Taken.of(blind(seen, slice(63, None)), "o.npz")
    assert len(taken.observation.times) == 63
    assert np.isfinite(taken.observation.points).all()


@pytest.mark.parametrize(
    ("hidden", "line"),
    [
        (slice(5, 75), r"seen in at least 6 of the frames before 2\.1 s, .* found 5 such frames"),
        (slice(20, 88), r"seen in at least 3 of the frames from 2\.1 s on, .* found 2 such frames"),
    ],
)
def test_too_little_to_fit_or_to_judge_by_is_refused(seen, hidden, line):
    with pytest.raises(InputError, match=rf"^o\.npz: points: expected 3 or more {line}$"):
        Taken.of(blind(seen, hidden), "o.npz")


def test_a_report_speaks_of_all_frames_of_the_recording(seen):
    """Nothing of the gap lies in frames that were left out."""
    with pytest.warns(UserWarning, match="left out"):
        taken = Taken.of(blind(seen, slice(0, 20), slice(80, None)), "o.npz")
    said = taken.report(found(taken)).where
    assert len(said.frames) == FRAMES
    assert not any(said.frames[:20])
    assert not any(said.frames[80:])
    assert said.frames[20:80] == found(taken).where.frames
    assert said.points == found(taken).where.points


@pytest.fixture
def dense(seen) -> Observation:
    """The same sheet of 1600 points, some never seen, some seldom."""
    u, v = np.meshgrid(np.linspace(0, 0.4, 40), np.linspace(0, 0.4, 40), indexing="ij")
    places = np.stack([u, 0 * u, 1.0 - v], -1).reshape(-1, 3)
    points = (places + seen.controllers - seen.controllers[:1]).astype(np.float32)
    points[:, 100:110] = np.nan
    points[:80, 500:700] = np.nan
    return replace(seen, points=points, parts=np.arange(1600))


def test_many_points_are_told_by_some_that_cover_the_object(dense):
    with pytest.warns(UserWarning, match=r"^o\.npz: 1600 points are more than a diagnosis can look at: 400 "):
        taken = Taken.of(dense, "o.npz")
    assert len(taken.kept) == MOST == taken.observation.points.shape[1]
    assert not set(taken.kept) & {*range(100, 110), *range(500, 700)}
    np.testing.assert_array_equal(taken.observation.parts, taken.kept)
    said, before = taken.report(found(taken)).where, found(taken).where
    assert len(said.points) == len(said.acts_on) == 1600
    assert sum(said.points) == pytest.approx(1.0)
    assert not any(said.points[100:110])
    for point in (0, 600, 1599):
        near = int(taken.stands_in[point])
        apart = dense.points[80, point] - dense.points[80, taken.kept[near]]
        assert np.linalg.norm(apart) < 0.025 + 0.05 * (point == 600)
        assert said.acts_on[point] == before.acts_on[near]
    own = np.array(said.points)
    assert own[taken.stands_in == 7].sum() == pytest.approx(before.points[7])


def test_parts_have_what_their_points_have_though_some_points_stand_for_all(dense):
    with pytest.warns(UserWarning, match="points are more than a diagnosis can look at"):
        kept = Taken.of(dense, "o.npz").kept
    parts = np.where(np.arange(1600) < 800, 5, 9)
    parts[np.setdiff1d(np.arange(80), kept)[0]] = 3  # of which no point is looked at
    with pytest.warns(UserWarning, match="points are more than a diagnosis can look at"):
        taken = Taken.of(replace(dense, parts=parts), "o.npz")
    shares = tuple(PartShare(part=label, share=0.5) for label in (5, 9))
    some = found(taken)
    where = some.where.model_copy(update={"parts": shares})
    told = taken.report(some.model_copy(update={"where": where})).where
    assert [each.part for each in told.parts] == [3, 5, 9]
    for each in told.parts:
        assert each.share == pytest.approx(np.array(told.points)[parts == each.part].sum())


def test_points_in_one_place_lose_nothing(seen):
    points = np.repeat(seen.points, 10, axis=1)
    with pytest.warns(UserWarning, match="640 points are more than a diagnosis can look at"):
        taken = Taken.of(replace(seen, points=points), "o.npz")
    assert sum(taken.report(found(taken)).where.points) == pytest.approx(1.0)
    np.testing.assert_array_equal(taken.stands_in[taken.kept], np.arange(len(taken.kept)))


def test_the_order_of_many_points_does_not_matter(dense):
    order = np.random.default_rng(0).permutation(1600)
    points = dense.points + np.random.default_rng(1).normal(0, 1e-3, dense.points.shape).astype(np.float32)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        one = Taken.of(replace(dense, points=points), "o.npz")
        other = Taken.of(replace(dense, points=points[:, order]), "o.npz")
    assert set(order[other.kept]) == set(one.kept)


def test_another_recording_is_told_by_the_same_points(dense):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        taken = Taken.of(dense, "o.npz")
    again = replace(dense, points=1.2 * dense.points)
    np.testing.assert_array_equal(taken.other(again, "p.npz").points, again.points[:, taken.kept])


def test_another_recording_of_other_points_is_covered_by_its_own(dense):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        taken = Taken.of(dense, "o.npz")
    elsewhere = dense.controllers + np.float32(0.02)
    some = replace(dense, points=1.2 * dense.points[:, ::2], controllers=elsewhere, parts=None)
    assert taken.other(some, "p.npz").points.shape[1] == len(taken.kept)
    few = replace(dense, points=1.2 * dense.points[:, ::20], controllers=elsewhere, parts=None)
    np.testing.assert_array_equal(taken.other(few, "p.npz").points, few.points)


def test_another_recording_in_which_nothing_moves_is_taken_with_a_warning(seen):
    """It confirms little; the first can be diagnosed all the same."""
    noise = np.random.default_rng(4).normal(0, 2e-3, seen.points.shape)
    rest = replace(
        seen,
        points=(seen.points[:1] + noise).astype(np.float32),
        controllers=np.repeat(seen.controllers[:1], FRAMES, 0),
    )
    with pytest.raises(InputError, match="expected an object that moves"):
        Taken.of(rest, "o.npz")
    with pytest.warns(UserWarning, match=r"^p\.npz: nothing moves by more than .* it confirms little$"):
        np.testing.assert_array_equal(Taken.of(seen, "o.npz").other(rest, "p.npz").points, rest.points)
