import numpy as np
import pytest

from model.scenes.world.cases import SPLIT, draw_cases
from model.scenes.world.shapes import CLASSES


@pytest.fixture(scope="module")
def plush():
    return draw_cases(3, 0, "plush", interactions=3)


def test_one_object_keeps_its_twin_through_different_interactions(plush):
    first, *others = plush
    assert len({case.interaction for case in plush}) == 3
    for case in others:
        assert case.object_name == first.object_name
        np.testing.assert_array_equal(case.topology.springs, first.topology.springs)
        np.testing.assert_array_equal(case.topology.part, first.topology.part)
        np.testing.assert_allclose(case.topology.rest_length, first.topology.rest_length)
        np.testing.assert_array_equal(case.truth.modulus, first.truth.modulus)


def test_a_case_begins_at_rest_above_the_ground_and_moves(plush):
    for case in plush:
        np.testing.assert_allclose(case.complete[0], case.rest, atol=2e-3)
        assert case.rest[:, 2].min() > -1e-6
        assert case.complete[..., 2].min() > -0.015
        assert np.linalg.norm(case.complete - case.rest, axis=2).max() > 0.02
        assert case.split == int(SPLIT * len(case.observation.times))


def test_sensors_take_turns_and_the_first_frame_is_seen(plush):
    assert {case.camera is None for case in plush} == {True, False}
    for case in plush:
        seen = np.isfinite(case.observation.points[..., 0])
        assert seen[0].all()
        assert 0.2 < seen.mean() < 1.0


def test_equal_numbers_give_equal_cases(plush):
    again = draw_cases(3, 0, "plush", interactions=3)
    for one, other in zip(plush, again, strict=True):
        np.testing.assert_array_equal(one.observation.points, other.observation.points)
    assert draw_cases(3, 6, "plush", interactions=1)[0].truth.modulus[0] != plush[0].truth.modulus[0]


@pytest.mark.parametrize("kind", CLASSES)
def test_every_class_makes_cases(kind):
    (case,) = draw_cases(5, 1, kind, interactions=1)
    assert case.object_class == kind
    assert 1 <= len(case.priors) <= 5
    assert np.isfinite(case.complete).all()
    np.testing.assert_allclose(case.gaussians.volumes.sum() > 0, True)
