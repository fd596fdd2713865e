"""The picture of a highlighted part."""

import cv2
import numpy as np

from model.priors.overlay import overlay, overlay_png
from model.types import PartView


def view(part=(20, 40, 30, 60), whole=(20, 80, 30, 100), size=(120, 160), **changes):
    image = np.random.default_rng(0).integers(60, 200, (*size, 3), dtype=np.uint8)
    mask, object_mask = np.zeros(size, bool), np.zeros(size, bool)
    mask[part[0] : part[1], part[2] : part[3]] = True
    object_mask[whole[0] : whole[1], whole[2] : whole[3]] = True
    return PartView(**{"image": image, "mask": mask, "object_mask": object_mask, "label": "part 0"} | changes)


def crop_origin(part):
    rows, columns = np.nonzero(part.object_mask)
    margin = int(np.ceil(0.15 * max(np.ptp(rows), np.ptp(columns)))) + 2
    return max(0, rows.min() - margin), max(0, columns.min() - margin)


def test_the_part_is_tinted_outlined_and_the_rest_dimmed():
    part = view()
    shown = overlay(part).astype(float)
    top, left = crop_origin(part)
    image = part.image[top : top + shown.shape[0], left : left + shown.shape[1]].astype(float)
    mask = part.mask[top : top + shown.shape[0], left : left + shown.shape[1]]
    inner = cv2.erode(mask.astype(np.uint8), np.ones((7, 7))) > 0
    outer = cv2.dilate(mask.astype(np.uint8), np.ones((7, 7))) == 0
    np.testing.assert_allclose(shown[outer], 0.35 * image[outer], atol=0.51)
    np.testing.assert_allclose(shown[inner], 0.85 * image[inner] + 0.15 * np.array([255, 120, 0]), atol=0.51)
    edge = mask & ~(cv2.erode(mask.astype(np.uint8), np.ones((3, 3))) > 0)
    assert (shown[edge] == [255, 120, 0]).all()


def test_it_shows_the_object_with_some_surroundings_and_no_more():
    shown = overlay(view(size=(400, 500)))
    assert shown.shape == (60 + 2 * 13, 70 + 2 * 13, 3)


def test_png_holds_the_same_picture():
    part = view()
    data = overlay_png(part)
    assert data.startswith(b"\x89PNG")
    decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    np.testing.assert_array_equal(decoded, overlay(part))
    assert overlay_png(part) == data


def test_a_hidden_part_leaves_the_dimmed_object():
    hidden = view()
    hidden = view(mask=np.zeros_like(hidden.mask))
    shown = overlay(hidden)
    assert shown.max() <= round(0.35 * 200)


def test_nothing_at_all_shows_the_whole_image():
    empty = np.zeros((120, 160), bool)
    assert overlay(view(mask=empty, object_mask=empty)).shape == (120, 160, 3)
