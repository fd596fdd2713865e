import numpy as np

from model.backdrops import plate, shade, studio
from model.types import Frames, Masks
from model.views import look_at

CAMERA = look_at(np.array([0.0, -0.8, 0.6]), np.array([0.0, 0.0, 0.0]), 200.0, 160, 120)


def test_a_plate_has_neither_object_nor_hand():
    rng = np.random.default_rng(0)
    scene = rng.integers(90, 110, (60, 80, 3)).astype(np.uint8)
    images, things, hands = [], [], []
    for t in range(12):
        image, thing, hand = scene.copy(), np.zeros((60, 80), bool), np.zeros((60, 80), bool)
        thing[20:40, 5 + 4 * t : 25 + 4 * t] = True
        thing[50:58, 30:40] = True  # here the scene is never seen
        hand[:10, 4 * t : 4 * t + 8] = True
        image[thing], image[hand] = (255, 0, 0), (255, 255, 255)
        images.append(image)
        things.append(thing)
        hands.append(hand)
    frames = Frames(np.stack(images), np.arange(12) / 30, "clip", "0" * 64)
    found = plate(frames, Masks(np.stack(things), np.stack(hands), 0), 80, 60)
    assert found.shape == (60, 80, 3)
    expected = 0.62 * 100 / 255
    assert np.abs(found - expected).max() < 0.03


def test_a_studio_has_floor_lines_only_on_a_ground():
    plain, floor = studio(CAMERA, None), studio(CAMERA, 0.0)
    assert plain.shape == floor.shape == (120, 160, 3)
    assert np.ptp(plain, axis=1).max() < 1e-6
    assert np.ptp(floor[60:], axis=1).max() > 0.03
    x, y = np.round(CAMERA.project(np.array([0.05, 0.0, 0.0]))[0]).astype(int)
    assert floor[y, x, 0] < floor[y - 4, x + 5, 0] - 0.01  # on a line, and between lines
    assert studio(CAMERA, 1.0).shape == (120, 160, 3)  # the ground above the camera: it only shows overhead


def test_a_shadow_falls_under_the_body_and_wanders_as_it_rises():
    bright = np.full((120, 160, 3), 0.8, np.float32)
    rng = np.random.default_rng(1)
    body = rng.uniform(-0.04, 0.04, (3000, 3)) + np.array([0, 0, 0.04])
    volumes = np.full(3000, 0.08**3 / 3000)

    def middle(lift):
        shaded = shade(bright, body + np.array([0, 0, lift]), volumes, 0.0, CAMERA)
        assert shaded.max() <= 0.8 + 1e-6
        assert shaded.min() < 0.6
        dark = 0.8 - shaded[..., 0]
        return (np.mgrid[:120, :160][::-1] * dark).sum(axis=(1, 2)) / dark.sum()

    expected = CAMERA.project(np.array([0.01, 0.014, 0.0]))[0]
    np.testing.assert_allclose(middle(0.0), expected, atol=5)
    assert middle(0.2)[0] > middle(0.0)[0] + 5


def test_no_shadow_of_what_is_out_of_sight():
    bright = np.full((120, 160, 3), 0.8, np.float32)
    far = np.array([[50.0, -50.0, 0.1], [0.0, -5.0, 0.1]])
    np.testing.assert_allclose(shade(bright, far, np.full(2, 1e-3), 0.0, CAMERA), bright)
