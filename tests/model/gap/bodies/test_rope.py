"""The middle line of a rope, thin or thick."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from model.gap.bodies.body import body_of
from model.gap.bodies.rope import is_line, is_thick

LENGTH, NOISE = 0.8, 1e-3


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("bend", [0.0, 1.2, -2.5])
def test_the_middle_of_a_thick_rope_is_where_its_skin_is_around_it(seed, bend, thick_rope):
    seen, middle = thick_rope(seed, bend=bend)
    body = body_of(seen, "rope")
    assert cKDTree(middle).query(body.points)[0][2:-2].max() < 0.003, "a third of how thick it is"
    length = np.linalg.norm(np.diff(body.points, axis=0), axis=1).sum()
    assert length == pytest.approx(LENGTH, rel=0.04), "a line through means of slices is a tenth longer"
    assert is_line(body.springs, len(body.points))


def test_of_a_rope_that_is_seen_from_one_side_the_middle_is_no_mean(thick_rope):
    seen, middle = thick_rope(3, count=240)
    front = seen.points[0, :, 1] > -0.002
    one_side = type(seen)(seen.times, seen.points[:, front], seen.controllers)
    body = body_of(one_side, "rope")
    assert np.abs(seen.points[0, front, 1]).mean() > 0.005
    assert abs(body.points[2:-2, 1].mean()) < 0.002
    assert cKDTree(middle).query(body.points)[0][2:-2].max() < 0.004


def test_what_is_seen_of_a_thick_rope_is_where_it_was_seen(thick_rope):
    seen, _ = thick_rope(4)
    body = body_of(seen, "rope")
    assert body.aside is not None
    made = (body.weight[..., None] * body.points[body.index]).sum(1) + body.aside.turned(body.points)
    assert np.sqrt(np.mean((made - seen.points[0]) ** 2)) < 1.3 * NOISE


def test_a_thin_rope_is_its_line(thick_rope):
    seen, middle = thick_rope(5, radius=0.001)
    body = body_of(seen, "rope")
    assert body.aside is None
    assert body.above == 0.0
    assert cKDTree(middle).query(body.points)[0].max() < 0.003


def test_few_places_are_a_line_of_their_own(thick_rope):
    assert body_of(thick_rope(6, count=12)[0], "rope").aside is None


def test_the_middle_of_a_rope_that_lies_is_above_the_ground(thick_rope):
    body = body_of(thick_rope(7, lying=True)[0], "rope")
    assert 0.006 < body.above < 0.011
    assert body.above == pytest.approx(np.quantile(body.points[:, 2], 0.1), abs=0.002)


def test_places_farther_from_a_line_than_noise_makes_them_are_on_a_skin():
    line = np.stack([np.linspace(0, 1, 30), np.zeros(30), np.zeros(30)], 1)
    rng = np.random.default_rng(7)
    beside = np.stack(
        [rng.uniform(-0.1, 1.1, 60), 0.003 * rng.normal(size=60), 0.003 * rng.normal(size=60)], 1
    )
    assert is_thick(beside, line, 0.002)
    assert not is_thick(beside, line, 0.004)
    assert not is_thick(beside, line[:1], 0.001)
    beside[:40] = np.nan
    assert not is_thick(beside, line, 0.001), "few are seen"


def test_a_ring_or_a_net_is_no_line():
    row = np.stack([np.arange(4), np.arange(1, 5)], 1)
    assert is_line(row, 5)
    assert not is_line(np.concatenate([row, [[0, 4]]]), 5)
    assert not is_line(row[::-1], 5)
