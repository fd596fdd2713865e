import numpy as np

from model.reconstruction.support import background_of, find_support, sampled
from model.types import Frames, Masks


def test_an_object_on_an_even_static_table_is_supported(teddy):
    support = find_support(teddy.frames, teddy.masks)
    assert support.present
    assert support.static
    assert "static surface" in support.reason


def test_an_object_before_a_changing_background_is_held_in_the_air(scene_of):
    scene = scene_of([((0, 0, 0), (0.06, 0.06, 0.06))], table=False)
    support = find_support(scene.frames, scene.masks)
    assert not support.present
    assert not support.static
    assert "held in the air" in support.reason


def test_clutter_that_stands_still_is_no_table_under_a_moving_object(scene_of):
    scene = scene_of([((0, 0, 0), (0.06, 0.06, 0.06))], table=False)
    images = np.repeat(scene.frames.images[:1], 4, axis=0)
    moving = np.stack([np.roll(scene.mask, 12 * i, axis=1) for i in range(4)])
    frames = Frames(images, np.arange(4) / 8.0, "clutter", "0" * 64)
    support = find_support(frames, Masks(moving, np.zeros_like(moving), 0))
    assert support.static
    assert not support.present


def test_a_textured_table_supports_what_keeps_still(scene_of):
    scene = scene_of([((0, 0, 0), (0.06, 0.06, 0.06))], table=False)
    images = np.repeat(scene.frames.images[:1], 4, axis=0)
    frames = Frames(images, np.arange(4) / 8.0, "clutter", "0" * 64)
    assert find_support(frames, scene.masks).present


def test_an_object_that_fills_the_image_is_not_judged(teddy):
    full = np.ones_like(teddy.masks.object)
    assert not find_support(teddy.frames, Masks(full, np.zeros_like(full), 0)).present


def test_the_background_is_what_stays(teddy):
    images = np.repeat(teddy.frames.images[:1], 9, axis=0).copy()
    images[:3, 10:20, 10:20] = 0
    frames = Frames(images, np.arange(9) / 30.0, "passing", "0" * 64)
    np.testing.assert_array_equal(background_of(frames), teddy.image)
    assert sampled(3) == [0, 1, 2]
    assert sampled(100)[0] == 0
    assert sampled(100)[-1] == 99
