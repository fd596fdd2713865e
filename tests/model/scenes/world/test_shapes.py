import numpy as np
import pytest

from model.scenes.world.shapes import CLASSES, draw_shape


@pytest.mark.parametrize("kind", CLASSES)
def test_shapes_stand_on_the_ground_have_one_to_five_parts_and_are_of_handy_size(kind):
    seen = set()
    for seed in range(12):
        shape = draw_shape(kind, np.random.default_rng(seed))
        points = shape.body.fill(800, np.random.default_rng(0))
        parts = np.unique(shape.body.part(points))
        assert shape.object_class == kind
        np.testing.assert_array_equal(parts, np.arange(shape.body.parts))
        assert -0.01 < points[:, 2].min() < 0.02
        assert 0.1 < np.ptp(points, axis=0).max() < 0.95
        seen.add(shape.body.parts)
    assert max(seen) > 1
    assert max(seen) <= 5


@pytest.mark.parametrize("kind", CLASSES)
def test_hands_take_an_object_where_it_is(kind):
    for seed in range(4):
        shape = draw_shape(kind, np.random.default_rng(seed))
        points = shape.body.fill(1500, np.random.default_rng(0))
        gaps = np.linalg.norm(points[:, None] - shape.grips, axis=2).min(axis=0)
        assert gaps.max() < 0.05


def test_mixed_objects_have_several_parts():
    parts = [draw_shape("mixed", np.random.default_rng(seed)).body.parts for seed in range(10)]
    assert min(parts) >= 2
