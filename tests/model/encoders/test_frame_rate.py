"""Clips of other frame rates are described as one of the usual one."""

from dataclasses import replace

import numpy as np
import pytest

from model.encoders.frame_rate import FRAME_RATE, at_frame_rate
from model.encoders.motion import MotionClip, ReferenceMotion


def curve(times):
    """Two points on smooth ways [m], one nearly straight."""
    angle = 2.0 * times
    circle = np.stack([np.cos(angle), np.sin(angle), 0.0 * times], axis=-1)
    line = np.stack([0.4 * times, -0.2 * times, times], axis=-1)
    return np.stack([circle, line], axis=1).astype(np.float32)


def clip_and_references(times, frames=None):
    points = curve(times)
    clip = MotionClip(
        times=times,
        rest=points[0],
        points=points,
        part=np.zeros(2, int),
        parts=1,
        controllers=points[:, :1],
        gravity=(0.0, 0.0, -9.81),
        images=np.zeros((len(times), 2, 2, 3), np.uint8),
    )
    compared = points[:frames]
    references = ReferenceMotion(
        sweep_log_modulus=np.array([1.0, 2.0]),
        sweep=np.stack([compared, compared + 1.0]),
        base_log_modulus=np.zeros(1),
        base=compared,
        base_globals=np.zeros(4),
        varied=np.stack([compared - 1.0, compared, compared]),
        steps=np.ones(3),
    )
    return clip, references


@pytest.mark.parametrize("rate", [30.0, 29.97])
def test_the_usual_frame_rate_stays_as_it_is(rate):
    clip, references = clip_and_references(2.0 + np.arange(20) / rate)
    same = at_frame_rate(clip, references)
    assert same[0] is clip
    assert same[1] is references


@pytest.mark.parametrize(
    ("rate", "atol"), [(60.0, 1e-6), (90.0, 1e-6), (50.0, 2e-5), (20.0, 1e-3), (7.5, 6e-3)]
)
def test_other_frame_rates_show_what_would_have_been_filmed(rate, atol):
    clip, references = clip_and_references(0.5 + np.arange(int(2 * rate) + 1) / rate)
    seen, compared = at_frame_rate(clip, references)
    np.testing.assert_allclose(seen.times, 0.5 + np.arange(61) / FRAME_RATE)
    expected = curve(seen.times)
    np.testing.assert_allclose(seen.points, expected, atol=atol)
    np.testing.assert_allclose(seen.controllers, expected[:, :1], atol=atol)
    np.testing.assert_allclose(compared.base, seen.points, atol=1e-6)
    np.testing.assert_allclose(compared.sweep[1], seen.points + 1.0, atol=1e-6)
    np.testing.assert_allclose(compared.varied[0], seen.points - 1.0, atol=1e-6)
    assert seen.images is None


def test_frames_that_come_unevenly():
    times = np.cumsum(np.random.default_rng(0).uniform(0.01, 0.05, 40))
    clip, references = clip_and_references(times)
    seen, _ = at_frame_rate(clip, references)
    np.testing.assert_allclose(np.diff(seen.times), 1.0 / FRAME_RATE)
    np.testing.assert_allclose(seen.points, curve(seen.times), atol=2e-3)


def test_what_was_not_seen_stays_unseen_and_spreads_no_farther():
    clip, references = clip_and_references(np.arange(21) / 60.0)
    points = clip.points.copy()
    points[3, 0] = np.nan
    points[8, 1] = np.nan
    seen, _ = at_frame_rate(replace(clip, points=points), references)
    there = np.isfinite(seen.points).all(axis=-1)
    # frame 3 lies between two of the frames asked for, which are seen; frame 8 is the fifth of them
    assert there[:, 0].all()
    assert np.flatnonzero(~there[:, 1]).tolist() == [4]
    slow = clip_and_references(np.arange(11) / 15.0)
    points = slow[0].points.copy()
    points[5] = np.nan
    there = np.isfinite(at_frame_rate(replace(slow[0], points=points), slow[1])[0].points).all(axis=(1, 2))
    assert np.flatnonzero(~there).tolist() == [9, 10, 11]


def test_as_long_as_what_is_compared():
    clip, references = clip_and_references(np.arange(31) / 15.0, frames=11)
    seen, compared = at_frame_rate(clip, references)
    assert len(seen.times) == len(seen.points) == len(compared.base) == 21
