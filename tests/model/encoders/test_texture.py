"""Colour and texture features without weights."""

import numpy as np
import pytest

from model.encoders.texture import TextureEncoder


@pytest.fixture(scope="module")
def encoder():
    return TextureEncoder()


def noise_image(shape=(64, 96), seed=0):
    return np.random.default_rng(seed).integers(0, 256, (*shape, 3), dtype=np.uint8)


@pytest.mark.parametrize("shape", [(64, 96), (61, 99), (480, 848), (5, 3), (1, 1)])
def test_cells_are_about_four_pixels_and_cover_the_image(encoder, shape):
    features = encoder(noise_image(shape))
    assert features.shape == (max(1, round(shape[0] / 4)), max(1, round(shape[1] / 4)), encoder.dim)
    assert features.dtype == np.float32
    assert np.isfinite(features).all()


def test_same_image_same_bytes(encoder):
    assert encoder(noise_image()).tobytes() == encoder(noise_image()).tobytes()


def test_channels_are_normalised(encoder):
    features = encoder(noise_image((128, 128)))
    assert np.abs(features).max() < 5.0


def test_colours_of_equal_lightness_are_told_apart(encoder):
    image = np.zeros((64, 128, 3), np.uint8)
    image[:, :64] = (150, 100, 100)
    image[:, 64:] = (80, 120, 110)
    features = encoder(image)
    assert np.linalg.norm(features[8, 4] - features[8, -5]) > 2.0


def test_textures_of_equal_colour_are_told_apart(encoder):
    image = np.full((64, 192, 3), 128, np.uint8)
    image[:, 64:128] = np.where(np.arange(64) // 3 % 2 == 0, 88, 168)[None, :, None]
    image[:, 128:] = 128 + np.random.default_rng(0).normal(0, 40, (64, 64, 1)).round().clip(-100, 100)
    flat, stripes, noise = (encoder(image)[8, column, 9:] for column in (8, 24, 40))
    assert np.linalg.norm(flat - stripes) > 2.0
    assert np.linalg.norm(flat - noise) > 2.0
    assert np.linalg.norm(stripes - noise) > 1.0


def test_direction_of_stripes_shows_only_in_the_harmonics(encoder):
    stripes = np.where(np.arange(96) // 3 % 2 == 0, 88, 168).astype(np.uint8)
    upright = np.repeat(np.broadcast_to(stripes, (96, 96))[..., None], 3, axis=2)
    one, turned = encoder(upright)[12, 12], encoder(np.ascontiguousarray(upright.transpose(1, 0, 2)))[12, 12]
    harmonics = np.isin(np.arange(encoder.dim), [14, 15, 17, 18])
    assert np.abs(one - turned)[~harmonics].max() < 0.05
    assert np.abs(one - turned)[harmonics].max() > 0.5


def test_sensor_noise_on_flat_colour_is_no_texture(encoder):
    flat = np.full((64, 64, 3), 120, np.uint8)
    noisy = (flat + np.random.default_rng(0).integers(-1, 2, flat.shape)).astype(np.uint8)
    textured = (flat + np.random.default_rng(0).integers(-40, 41, flat.shape)).astype(np.uint8)
    quiet = np.linalg.norm(encoder(flat) - encoder(noisy), axis=-1).mean()
    loud = np.linalg.norm(encoder(flat) - encoder(textured), axis=-1).mean()
    assert quiet < 0.3 * loud
