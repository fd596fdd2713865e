import dataclasses

import numpy as np
import pytest

from model.errors import InputError
from model.segmentation import ClassicalSegmenter
from model.types import Masks, Prompt


def overlap(a, b):
    return (a & b).sum() / max((a | b).sum(), 1)


@pytest.fixture(scope="module")
def clip(make_scene):
    return make_scene()


@pytest.fixture(scope="module")
def masks(clip):
    return ClassicalSegmenter()(clip[0], Prompt())


def test_finds_object_and_hand_in_every_frame(clip, masks):
    _, objects, hands = clip
    assert masks.keyframe == 0
    for found, true in zip(masks.object, objects, strict=True):
        assert overlap(found, true) > 0.85
    for found, true in zip(masks.hand, hands, strict=True):
        assert overlap(found, true) > 0.7
    assert not (masks.object & masks.hand).any()
    assert not any("no hand" in warning for warning in masks.warnings)


def test_same_clip_same_masks(clip, masks):
    again = ClassicalSegmenter()(clip[0], Prompt())
    for field in dataclasses.fields(Masks):
        np.testing.assert_array_equal(getattr(again, field.name), getattr(masks, field.name))


def test_a_users_mask_is_taken_as_it_is(clip):
    frames, objects, _ = clip
    masks = ClassicalSegmenter()(frames, Prompt(mask=objects[6], keyframe=6))
    assert masks.keyframe == 6
    np.testing.assert_array_equal(masks.object[6], objects[6])
    assert min(overlap(masks.object[i], objects[i]) for i in (0, 11)) > 0.85


def test_a_users_box_limits_the_search(clip):
    frames, objects, _ = clip
    masks = ClassicalSegmenter()(frames, Prompt(box=(45, 50, 62, 48), keyframe=0))
    assert overlap(masks.object[0], objects[0]) > 0.85


def test_a_keyframe_is_kept(clip):
    frames, objects, _ = clip
    masks = ClassicalSegmenter()(frames, Prompt(keyframe=5))
    assert masks.keyframe == 5
    assert overlap(masks.object[5], objects[5]) > 0.85


def test_no_hand_is_a_warning(make_scene):
    frames, objects, _ = make_scene(8, hand=False)
    masks = ClassicalSegmenter()(frames, Prompt())
    assert "no hand was found at the object" in masks.warnings
    assert overlap(masks.object[4], objects[4]) > 0.8


def test_something_follows_the_keyframe(make_scene):
    """Nothing is there until the last frame."""
    frames, _, _ = make_scene(11)
    empty, _, _ = make_scene(11, hand=False, thing=False)
    late = dataclasses.replace(frames, images=np.concatenate([empty.images[:10], frames.images[10:]]))
    with pytest.raises(InputError, match="no object found"):
        ClassicalSegmenter()(late, Prompt())


def test_nothing_to_find_is_refused(make_scene):
    frames, _, _ = make_scene(6, hand=False, thing=False)
    with pytest.raises(InputError, match=r"no object found.*--box.*--mask"):
        ClassicalSegmenter()(frames, Prompt())


def test_a_narrow_strip_of_a_clip_is_refused(clip):
    frames = dataclasses.replace(clip[0], images=np.zeros((6, 16, 960, 3), np.uint8), times=np.arange(6) / 30)
    with pytest.raises(InputError, match="960×16 pixels are too narrow"):
        ClassicalSegmenter()(frames, Prompt(box=(10, 2, 100, 8)))


@pytest.mark.parametrize(
    ("prompt", "message"),
    [
        (Prompt(mask=np.ones((4, 5), bool)), "the mask is 5×4 pixels, the frames are 200×120"),
        (Prompt(mask=np.zeros((120, 200), bool)), "the mask is empty"),
        (Prompt(box=(190, 0, 20, 20)), "does not lie within the 200×120 frames"),
        (Prompt(box=(0, 0, 0, 20)), "does not lie within"),
        (Prompt(keyframe=12), "frames 0 to 11"),
    ],
)
def test_prompts_that_do_not_fit_are_refused(clip, prompt, message):
    with pytest.raises(InputError, match=message):
        ClassicalSegmenter()(clip[0], prompt)
