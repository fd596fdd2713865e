import cv2
import numpy as np
import pytest

from model.reconstruction.shape import classify_shape

SIZE = (240, 320)


def picture(mask, shade=None):
    """A green thing, lit evenly or by `shade`."""
    image = np.full((*SIZE, 3), 220, np.uint8)
    light = np.ones(SIZE) if shade is None else shade
    image[mask] = (light[..., None] * [90, 160, 70])[mask].astype(np.uint8)
    return image


def drawn(draw):
    canvas = np.zeros(SIZE, np.uint8)
    draw(canvas)
    return canvas > 0


def bent_strand(thickness):
    angle = np.linspace(0.2, 2.8, 60)
    points = np.stack([160 + 110 * np.cos(angle), 180 - 110 * np.sin(angle)], -1).round().astype(np.int32)
    return drawn(lambda canvas: cv2.polylines(canvas, [points], False, 255, thickness))


TRAPEZOID = np.array([[80, 60], [230, 60], [260, 200], [60, 200]], np.int32)


def star(canvas):
    cv2.circle(canvas, (160, 120), 32, 255, -1)
    for angle in np.deg2rad([20, 100, 200, 290]):
        end = (int(160 + 95 * np.cos(angle)), int(120 + 95 * np.sin(angle)))
        cv2.line(canvas, (160, 120), end, 255, 22)


@pytest.mark.parametrize("thickness", [8, 16, 24])
def test_an_even_strand_is_a_rope_bent_or_not(thickness):
    straight = drawn(lambda canvas: cv2.line(canvas, (40, 120), (280, 130), 255, thickness))
    assert classify_shape(picture(straight), straight) == "rope"
    bent = bent_strand(thickness)
    assert classify_shape(picture(bent), bent) == "rope"


def test_an_evenly_lit_quadrilateral_is_a_sheet():
    mask = drawn(lambda canvas: cv2.fillPoly(canvas, [TRAPEZOID], 255))
    assert classify_shape(picture(mask), mask) == "sheet"


def test_a_shaded_quadrilateral_is_a_cushion():
    mask = drawn(lambda canvas: cv2.fillPoly(canvas, [TRAPEZOID], 255))
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    shade = 1.3 - 0.9 * np.hypot((x - 160) / 120, (y - 130) / 90)
    assert classify_shape(picture(mask, shade.clip(0.3, 1.3)), mask) == "solid"


def test_a_body_with_limbs_is_solid():
    mask = drawn(star)
    assert classify_shape(picture(mask), mask) == "solid"


def test_a_disc_is_no_rope_and_an_uneven_strand_neither():
    disc = drawn(lambda canvas: cv2.circle(canvas, (160, 120), 60, 255, -1))
    assert classify_shape(picture(disc), disc) != "rope"

    def club(canvas):
        cv2.line(canvas, (40, 120), (280, 120), 255, 10)
        cv2.circle(canvas, (250, 120), 45, 255, -1)

    mask = drawn(club)
    assert classify_shape(picture(mask), mask) == "solid"
