"""Places on the skin of a rope."""

import numpy as np

from benchmarks.reality.tube import AROUND, on_skin, tangents, untwisted
from benchmarks.reality.world import Motion

RADIUS = 0.01


def bending(frames=7, count=60):
    """A line that bends into an arc, in a plane that leans, and turns about the vertical."""
    along = np.linspace(0, 0.6, count)
    lines = []
    for share in np.linspace(1e-6, 3.0, frames):
        angle = share * along / 0.6
        flat = 0.6 / share * np.stack([np.sin(angle), 1 - np.cos(angle), 0.2 * angle], -1)
        c, s = np.cos(share), np.sin(share)
        lines.append(flat @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))
    return np.stack(lines)


def moved(line):
    return Motion(line, {"wind": np.linspace(0, 1, line.shape[1])}, line, np.zeros((0, 4)))


def test_normals_are_unit_vectors_across_the_line():
    line = bending()
    up, side = untwisted(line)
    tangent = tangents(line)
    for normal in (up, side):
        np.testing.assert_allclose(np.linalg.norm(normal, axis=2), 1.0)
        assert np.abs((normal * tangent).sum(-1)).max() < 1e-12
    assert np.abs((up * side).sum(-1)).max() < 1e-12


def test_normals_turn_about_the_line_no_more_than_they_must():
    """Of an arc in a plane one that is across the plane stays across it, all along."""
    angle = np.linspace(0, 2.5, 80)
    arc = np.stack([np.sin(angle), 0 * angle, 1 - np.cos(angle)], -1)[None]
    up, side = untwisted(arc)
    across = np.stack([up[0, :, 1], side[0, :, 1]], 1)
    assert np.abs(across - across[0]).max() < 1e-3


def test_points_side_by_side_do_not_say_how_the_line_runs():
    line = bending()
    beside = np.insert(line, 20, line[:, 20] + 1e-5 * np.array([0.0, 1.0, 0.0]), axis=1)
    turn = np.arccos(np.clip((tangents(beside)[:, 20] * tangents(line)[:, 20]).sum(-1), -1, 1))
    assert turn.max() < 0.1


def test_places_are_as_far_from_the_line_as_the_rope_is_thick_and_the_same_in_both_recordings():
    line = bending()
    seen = on_skin(moved(line), RADIUS, np.random.default_rng(0))
    assert seen.points.shape == (len(line), AROUND * line.shape[1], 3)
    apart = np.linalg.norm(seen.points[:, :, None] - line[:, None], axis=-1).min(-1)
    assert apart.max() <= RADIUS + 1e-12
    assert apart.min() > 0.95 * RADIUS
    which = np.linalg.norm(seen.points[0][:, None] - line[0], axis=-1).argmin(1)
    np.testing.assert_allclose(seen.acts["wind"], np.linspace(0, 1, line.shape[1])[which], atol=0.03)
    again = on_skin(moved(line[:1]), RADIUS, np.random.default_rng(0))
    np.testing.assert_allclose(again.points[0], seen.points[0])
