"""Sheet, rope or solid from an outline."""

import cv2
import numpy as np
import pytest

from model.shape import guess_shape

SIZE = (240, 320)


def drawn(draw):
    canvas = np.zeros(SIZE, np.uint8)
    draw(canvas)
    return canvas > 0


def flat(mask, level=150):
    image = np.full((*SIZE, 3), 60, np.uint8)
    image[mask] = level
    return image


def rounded(mask, light=220, dark=60):
    """Lit from the left, darker to the right: what a body with volume looks like."""
    image = flat(mask)
    columns = np.nonzero(mask.any(axis=0))[0]
    ramp = np.interp(np.arange(SIZE[1]), [columns[0], columns[-1]], [light, dark])
    image[mask] = np.broadcast_to(ramp[None, :, None], image.shape)[mask].astype(np.uint8)
    return image


QUADRILATERAL = np.array([[80, 60], [230, 70], [250, 200], [60, 190]])
CURVE = np.array([[40, 180], [100, 100], [180, 110], [280, 60]])
CLOTH = drawn(lambda c: cv2.fillPoly(c, [QUADRILATERAL], 1))
ROPE = drawn(lambda c: cv2.polylines(c, [CURVE], False, 1, thickness=14))
BALL = drawn(lambda c: cv2.circle(c, (160, 120), 70, 1, -1))


def star(canvas):
    cv2.circle(canvas, (160, 120), 40, 1, -1)
    for end in [(60, 60), (260, 60), (80, 210), (240, 210)]:
        cv2.line(canvas, (160, 120), end, 1, thickness=24)


def spider(canvas):
    cv2.circle(canvas, (160, 120), 24, 1, -1)
    for angle in np.deg2rad([0, 60, 120, 180, 240, 300]):
        end = (int(160 + 112 * np.cos(angle)), int(120 + 112 * np.sin(angle)))
        cv2.line(canvas, (160, 120), end, 1, thickness=14)


@pytest.mark.parametrize(
    ("image", "mask", "shape"),
    [
        (flat(CLOTH), CLOTH, "sheet"),
        (rounded(CLOTH), CLOTH, "solid"),
        (flat(ROPE), ROPE, "rope"),
        (rounded(ROPE), ROPE, "rope"),
        (rounded(BALL), BALL, "solid"),
        (rounded(BALL, 160, 120), BALL, "solid"),
        (rounded(drawn(star)), drawn(star), "solid"),
        (rounded(drawn(spider)), drawn(spider), "solid"),
    ],
    ids=["cloth", "cushion", "rope", "lit rope", "ball", "softly lit ball", "toy", "thin-limbed toy"],
)
def test_outlines(image, mask, shape):
    assert guess_shape(image, mask) == shape


@pytest.mark.parametrize("quarter_turns", [1, 2, 3])
def test_turning_the_picture_changes_nothing(quarter_turns):
    for image, mask in ((flat(CLOTH), CLOTH), (flat(ROPE), ROPE), (rounded(BALL), BALL)):
        turned = [np.ascontiguousarray(np.rot90(each, quarter_turns)) for each in (image, mask)]
        assert guess_shape(*turned) == guess_shape(image, mask)


def test_specks_beside_the_object_do_not_count():
    mask = CLOTH.copy()
    mask[5:9, 300:304] = True
    assert guess_shape(flat(mask), mask) == "sheet"


def test_no_outline_is_solid():
    empty = np.zeros(SIZE, bool)
    assert guess_shape(flat(empty), empty) == "solid"


def test_a_single_pixel_is_judged():
    one = np.zeros(SIZE, bool)
    one[10, 10] = True
    assert guess_shape(flat(one), one) in ("sheet", "solid")


@pytest.mark.parametrize("thickness", [8, 16, 24])
def test_an_even_strand_is_a_rope_bent_or_not(thickness):
    straight = drawn(lambda canvas: cv2.line(canvas, (40, 120), (280, 130), 1, thickness))
    angle = np.linspace(0.2, 2.8, 60)
    arc = np.stack([160 + 110 * np.cos(angle), 180 - 110 * np.sin(angle)], -1).round().astype(np.int32)
    bent = drawn(lambda canvas: cv2.polylines(canvas, [arc], False, 1, thickness))
    assert guess_shape(flat(straight), straight) == "rope"
    assert guess_shape(flat(bent), bent) == "rope"


def test_a_strand_with_a_thick_end_is_no_rope():
    def club(canvas):
        cv2.line(canvas, (40, 120), (280, 120), 1, 10)
        cv2.circle(canvas, (250, 120), 45, 1, -1)

    mask = drawn(club)
    assert guess_shape(flat(mask), mask) == "solid"
