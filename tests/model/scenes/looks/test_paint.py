import numpy as np
import pytest

from model.errors import InputError
from model.priors.materials import MATERIALS
from model.scenes.looks import ALL_LOOKS, paint, wardrobe
from model.scenes.looks.paint import draw_look, texture_place
from model.types import Gaussians, Parts


@pytest.fixture
def body():
    rng = np.random.default_rng(0)
    means = rng.uniform([-0.12, -0.05, 0.0], [0.14, 0.05, 0.07], (2000, 3)).astype(np.float32)
    ones = np.ones(len(means), np.float32)
    upright = np.tile(np.array([1, 0, 0, 0], np.float32), (len(means), 1))
    return Gaussians(means, 0.004 * np.ones_like(means), upright, 0.9 * ones, 0 * means, 1e-7 * ones)


def test_every_material_has_one_look():
    assert tuple(look.material for look in ALL_LOOKS) == MATERIALS


def test_each_part_gets_its_material_and_only_colours_change(body):
    labels = (body.means[:, 0] > 0).astype(np.int32)
    painted = paint(body, Parts(labels, 2), [8, 9], np.random.default_rng(1))
    assert painted.means is body.means
    assert painted.scales is body.scales
    denim, fur = (painted.colors[labels == label].mean(axis=0) for label in (0, 1))
    assert denim[2] > denim[0] + 0.03  # blue
    assert fur[0] > fur[2] - 0.02  # not blue
    assert painted.colors.min() >= 0
    assert painted.colors.max() <= 1
    again = paint(body, Parts(labels, 2), np.array([8, 9]), np.random.default_rng(1))
    np.testing.assert_array_equal(again.colors, painted.colors)
    other = paint(body, Parts(labels, 2), [8, 9], np.random.default_rng(2))
    assert np.abs(other.colors - painted.colors).max() > 0.05


def test_materials_of_all_parts_are_needed(body):
    with pytest.raises(InputError, match="2 parts but 1 materials"):
        paint(body, Parts(np.zeros(2000, np.int32), 2), [3], np.random.default_rng(0))


def test_the_texture_stays_on_a_body_that_is_laid_elsewhere(body):
    angle = 1.1
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    moved = body.means.astype(np.float64) @ turn.T + [0.3, -0.2, 0.1]
    here, there = (texture_place(means, means) for means in (body.means, moved))
    np.testing.assert_allclose(here, there, atol=1e-6)


def test_the_wardrobe_of_an_object_is_its_own():
    one, again, other = (draw_look(0, wardrobe(name)) for name in ("bear-1", "bear-1", "bear-2"))
    assert one == again
    assert one != other
