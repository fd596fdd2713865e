"""Places cover a body, and lie in it however it is turned."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from model.gap.fields import PATCHES, centres, everywhere, first_places_of, near_places_of, rescaled

BODY = np.random.default_rng(4).uniform(0, 1, (80, 3)) * [0.4, 0.2, 0.1]


def test_centres_cover_a_body():
    near = np.linalg.norm(BODY[:, None] - BODY[centres(BODY, 10)][None], axis=-1).min(1)
    assert near.max() < 0.16


def test_places_turn_with_the_body():
    turned = Rotation.from_euler("zyx", [70, 20, 10], degrees=True).apply(BODY)
    before, after = (np.stack([p.field for p in first_places_of(b)]) for b in (BODY, turned))
    apart = np.abs(before[:, None] - after[None]).max(-1)
    assert apart.min(1).max() < 1e-6
    assert before.min() >= 0
    assert before.max() <= 1


def test_a_side_is_half_of_a_body():
    sides = [place for place in first_places_of(BODY) if place.kind == "side"]
    assert len(sides) == 6
    for place in sides:
        assert place.field.mean() == pytest.approx(0.5, abs=0.05)
        assert (BODY @ place.anchor)[place.field > 0.5].min() >= (BODY @ place.anchor)[
            place.field < 0.5
        ].max()


def test_a_thin_body_is_not_cut_across_its_thickness():
    assert len(first_places_of(BODY * [1, 1, 1e-3])) == 4 + PATCHES


def test_neighbours_of_a_place_are_larger_and_smaller():
    assert near_places_of(BODY, everywhere(BODY)) == []
    for place in first_places_of(BODY):
        sizes = sorted(other.field.sum() for other in near_places_of(BODY, place))
        assert sizes[0] < place.field.sum() < sizes[-1]


@pytest.mark.parametrize(
    ("field", "expected"), [([0.0, 0.2, 0.4], [0, 0.5, 1]), ([0.0, 0.0, 0.0], [1, 1, 1])]
)
def test_the_largest_value_is_one(field, expected):
    np.testing.assert_allclose(rescaled(np.array(field)), expected)
