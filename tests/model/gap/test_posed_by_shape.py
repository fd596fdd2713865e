"""A body is found in a recording whose points are not those of the first."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from model.errors import InputError
from model.gap.bodies.body import body_of
from model.gap.posed_by_shape import FoldedOtherwiseError, posed_by_shape
from model.types import Observation

FRAMES = 12
SHIFT = np.array([0.02, 0.0, 0.0])


def still(places, colors=None):
    """A recording in which nothing moves, seen with half a millimetre of noise."""
    noise = np.random.default_rng(len(places)).normal(0, 5e-4, (FRAMES, *places.shape))
    return Observation(
        times=np.arange(FRAMES) / 30.0,
        points=(places[None] + noise).astype(np.float32),
        controllers=np.zeros((FRAMES, 0, 3), np.float32),
        colors=colors,
    )


def cloth(count, seed):
    """Points on a cloth of 0.4 × 0.25 m: its own coordinates, from 0 to 1."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    kept = list(corners)
    for one in np.random.default_rng(seed).random((4000, 2)):
        if min(np.linalg.norm((one - other) * [0.4, 0.25]) for other in kept) > 0.015:
            kept.append(one)
        if len(kept) == count:
            break
    return np.stack(kept)


def flat(own):
    return np.stack([0.4 * own[:, 0], 0.25 * own[:, 1], 0 * own[:, 0]], -1)


def rolled(own, turn, shift):
    """Bent about its short side with a radius of 0.2 m, turned about the vertical, elsewhere."""
    angle = 0.4 * (own[:, 0] - 0.5) / 0.2
    places = np.stack([0.2 * np.sin(angle), 0.25 * (own[:, 1] - 0.5), 0.2 * (1 - np.cos(angle))], -1)
    c, s = np.cos(turn), np.sin(turn)
    return places @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + shift


def laid(first, other, shape):
    body = body_of(first, shape)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        points = posed_by_shape(body, first, other)
    assert len(said) == 1
    return body, points, str(said[0].message)


def test_a_cloth_that_is_bent_and_turned_is_found():
    first, other = cloth(120, 1), cloth(90, 2)
    body, points, _ = laid(still(flat(first)), still(rolled(other, 0.5, [0.1, 0.0, 0.2])), "sheet")
    own = body.points[:, :2] / [0.4, 0.25]
    away = np.linalg.norm(points - rolled(own, 0.5, [0.1, 0.0, 0.2]), axis=1)
    assert np.median(away) < 0.7 * body.spacing
    one, end = body.springs.T
    before, after = (np.linalg.norm(p[one] - p[end], axis=1) for p in (body.points, points))
    assert np.sqrt(np.mean((after / before - 1.0) ** 2)) < 0.03, "no spring is strained by much"


@pytest.mark.parametrize("turned", [False, True])
def test_colours_tell_which_end_is_which(turned):
    first, other = cloth(120, 1), cloth(90, 2)
    one, two = (np.pad(255 * own, ((0, 0), (0, 1))).astype(np.uint8) for own in (first, other))
    there = rolled(other, np.pi if turned else 0.0, [0.2, 0.1, 0.0])
    body, points, said = laid(still(flat(first), one), still(there, two), "sheet")
    right = rolled(body.points[:, :2] / [0.4, 0.25], np.pi if turned else 0.0, [0.2, 0.1, 0.0])
    assert np.median(np.linalg.norm(points - right, axis=1)) < body.spacing
    assert "which fits in" in said
    assert ("what colours and parts ask for" in said) == turned


def test_without_marks_it_lies_as_it_lay():
    first, other = cloth(120, 1), cloth(90, 2)
    body, points, said = laid(still(flat(first)), still(flat(other) + SHIFT), "sheet")
    assert np.median(np.linalg.norm(points - body.points - SHIFT, axis=1)) < body.spacing
    assert "the nearest to how it lay was taken" in said


def rope(count, seed, bend):
    """Points along a rope of 0.6 m that is bent evenly, and how far along each is."""
    along = np.sort(np.concatenate([[0.0, 0.6], np.random.default_rng(seed).uniform(0, 0.6, count)]))
    return along, bow(along, bend)


def bow(along, bend):
    if bend == 0.0:
        return np.stack([along, 0 * along, 0 * along], -1)
    angle = bend * along / 0.6
    return 0.6 / bend * np.stack([np.sin(angle), 0 * angle, 1 - np.cos(angle)], -1)


def test_a_rope_that_is_bent_otherwise_is_found():
    (_, first), (_, other) = rope(100, 1, 0.0), rope(60, 2, 2.0)
    body, points, _ = laid(still(first), still(other), "rope")
    away = np.linalg.norm(points - bow(body.points[:, 0], 2.0), axis=1)
    assert away.max() < 0.01
    steps = [np.linalg.norm(np.diff(p, axis=0), axis=1) for p in (body.points, points)]
    assert np.abs(steps[1] / steps[0] - 1.0).max() < 0.03


def test_a_solid_that_is_turned_about_the_vertical_is_found(egg):
    first, other = egg[::2], egg[1::2]
    c, s = np.cos(0.6), np.sin(0.6)
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    body, points, _ = laid(still(first), still(other @ turn + [0.3, 0.1, 0.0]), "solid")
    right = body.points @ turn + [0.3, 0.1, 0.0]
    # it is alike on both ends and on both sides
    assert np.median(cKDTree(right).query(points)[0]) < 0.5 * body.spacing
    assert np.median(np.linalg.norm(points - right, axis=1)) < body.spacing


@pytest.mark.parametrize("count", [3, 200])
def test_a_solid_of_which_one_plane_is_seen_is_refused(egg, count):
    """It would be laid flat."""
    other = still(egg[:count])
    level = other.points * np.array([1.0, 1.0, 0.0], np.float32)
    with pytest.raises(
        InputError, match="the other recording: points: all that are seen of a solid are in one"
    ):
        posed_by_shape(body_of(still(egg), "solid"), still(egg), replace(other, points=level))


def test_a_cloth_in_a_bundle_is_not_taken_for_another_one():
    """As large as it, and laid out by no bending: nothing says that it is another object."""
    rng = np.random.default_rng(0)
    flat = np.column_stack([rng.uniform(0.0, 0.4, (150, 2)), np.zeros(150)])
    around = 2.0 * np.pi * 2.5 * flat[:, 0] / 0.4
    bundle = np.column_stack([0.03 * np.cos(around), 0.03 * np.sin(around), 1.4 * flat[:, 1]])
    with pytest.raises(FoldedOtherwiseError, match="off that of the other however it is folded"):
        posed_by_shape(body_of(still(bundle), "sheet"), still(bundle), still(flat))


def test_another_object_is_refused(egg):
    body = body_of(still(egg), "solid")
    with pytest.raises(InputError, match=r"measures 0\.\d+ m, that of the first 0\.3 m"):
        posed_by_shape(body, still(egg), still(2.0 * egg))
    long = rope(100, 1, 0.0)[1]
    with pytest.raises(InputError, match=r"mm off that of the other wherever it is laid"):
        posed_by_shape(body, still(egg), still(0.3 / 0.6 * long[:, [2, 1, 0]]))
