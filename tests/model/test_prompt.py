from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from model.errors import InputError
from model.prompt import read_prompt
from model.types import Frames


@pytest.fixture
def frames() -> Frames:
    return Frames(np.zeros((4, 40, 60, 3), np.uint8), np.arange(4) / 30.0, "clip.mp4", "0" * 64)


def paint(path, width, height, channels=1):
    image = np.zeros((height, width, channels), np.uint8)
    image[height // 4 : height // 2, width // 4 : width // 2] = 255
    if channels == 4:
        image[..., :3] = 255
    cv2.imwrite(str(path), image)
    return path


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_reads_grey_colour_and_transparent_masks(frames, tmp_path, channels):
    prompt = read_prompt(frames, mask=paint(tmp_path / "m.png", 60, 40, channels), box=None, keyframe=None)
    assert prompt.mask is not None
    expected = np.zeros((40, 60), bool)
    expected[10:20, 15:30] = True
    np.testing.assert_array_equal(prompt.mask, expected)
    assert prompt.keyframe == 0


def test_a_palette_may_be_transparent(frames, tmp_path):
    """White on nothing, as drawing programs save it with few colours."""
    image = Image.new("P", (60, 40), 0)
    image.putpalette([255, 255, 255, 255, 255, 255])
    image.paste(1, (15, 10, 30, 20))
    image.save(tmp_path / "m.png", transparency=0)
    prompt = read_prompt(frames, mask=tmp_path / "m.png", box=None, keyframe=None)
    expected = np.zeros((40, 60), bool)
    expected[10:20, 15:30] = True
    np.testing.assert_array_equal(prompt.mask, expected)


@pytest.mark.parametrize("name", ["mk:colour.png", "mk%d.png", "http:.png"])
def test_the_name_of_a_mask_means_nothing(frames, tmp_path, name, monkeypatch):
    monkeypatch.chdir(tmp_path)
    prompt = read_prompt(frames, mask=paint(Path(name), 60, 40), box=None, keyframe=None)
    assert prompt.mask is not None


def test_a_mask_of_the_original_size_fits_a_clip_decoded_smaller(tmp_path):
    small = Frames(np.zeros((2, 40, 60, 3), np.uint8), np.arange(2) / 30.0, "c", "0" * 64, (), (120, 80))
    prompt = read_prompt(small, mask=paint(tmp_path / "m.png", 120, 80), box=None, keyframe=0)
    assert prompt.mask is not None
    assert prompt.mask.shape == (40, 60)
    assert read_prompt(small, mask=None, box=(10, 20, 40, 40), keyframe=None).box == (5, 10, 20, 20)


def test_the_keyframe_counts_the_frames_of_the_clip_itself():
    times = np.arange(4) / 10.0
    pixels = np.zeros((4, 40, 60, 3), np.uint8)
    thinned = Frames(pixels, times, "c", "0" * 64, numbers=np.array([0, 3, 6, 9]), clip_frames=12)
    exact = read_prompt(thinned, mask=None, box=None, keyframe=6)
    assert (exact.keyframe, exact.warnings) == (2, ())
    near = read_prompt(thinned, mask=None, box=None, keyframe=4)
    assert near.keyframe == 1
    assert near.warnings == ("frame 4 was left out in thinning the clip: the keyframe is 3",)
    for keyframe, said in ((12, "frames 0 to 11"), (11, "frames 0 to 6")):
        with pytest.raises(InputError, match=said):
            read_prompt(thinned, mask=None, box=None, keyframe=keyframe)


def test_refusals_are_one_line(frames, tmp_path):
    text = tmp_path / "text.png"
    text.write_text("hello")
    empty = tmp_path / "empty.png"
    cv2.imwrite(str(empty), np.zeros((40, 60), np.uint8))
    wrong = paint(tmp_path / "wrong.png", 50, 40)
    cases = [
        ({"mask": wrong}, "50×40.*60×40"),
        ({"mask": text}, "not a readable image"),
        ({"mask": empty}, "empty"),
        ({"mask": tmp_path / "none.png"}, "no such"),
        ({"box": (50, 0, 20, 20)}, "inside"),
        ({"box": (0, 0, 0, 5)}, "inside"),
        ({"keyframe": 4}, "frames 0 to 3"),
        ({"keyframe": 3}, "nothing follows it in clip.mp4; choose one of the frames 0 to 2"),
        ({"mask": wrong, "box": (0, 0, 5, 5)}, "choose one"),
    ]
    for given, message in cases:
        with pytest.raises(InputError, match=message) as caught:
            read_prompt(frames, **{"mask": None, "box": None, "keyframe": None, **given})
        assert "\n" not in str(caught.value)
