"""What one camera sees of a solid is one side; a cloth is borne by nothing but hands and the ground."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.bodies.body import body_of
from model.gap.bodies.borne import is_borne
from model.gap.bodies.guess import guess_shape
from model.types import Observation

NOISE = 1.5e-3


def seen(places, hands=(), ground=0.0):
    held = np.asarray(hands, np.float32).reshape(-1, 3)
    noise = np.random.default_rng(4).normal(0, NOISE, (12, *places.shape))
    return Observation(
        times=np.arange(12) / 30.0,
        points=(places[None] + noise).astype(np.float32),
        controllers=np.repeat(held[None], 12, 0),
        ground_height=ground,
    )


@pytest.fixture
def half(egg):
    """The upper half of an egg that lies on the ground, as far as it faces the camera."""
    return (egg + np.array([0.0, 0.0, 0.07]))[(egg[:, 2] > 0.0) & (egg[:, 1] < 0.05)]


@pytest.fixture
def cloth():
    """Points on a cloth of 0.4 × 0.3 m, from the middle."""
    u, v = np.meshgrid(np.linspace(-0.2, 0.2, 14), np.linspace(-0.15, 0.15, 11), indexing="ij")
    jitter = np.random.default_rng(2).uniform(-0.01, 0.01, (2, *u.shape))
    return np.stack([u + jitter[0], v + jitter[1], 0 * u], -1).reshape(-1, 3)


def test_one_side_of_a_solid_that_lies_is_borne(half):
    for hands in ((), half[half[:, 0] > 0.12]):
        recording = seen(half, hands)
        assert guess_shape(half) == "sheet"
        assert is_borne(recording, half)
        body = body_of(recording)
        assert body.shape == "solid"
        assert len(body.points) > len(half), "it is filled"


def test_what_lies_in_folds_is_not(cloth):
    x = cloth[:, 0]
    folded = cloth + np.stack([0 * x, 0 * x, 0.012 * (1 + np.cos(60 * x))], -1)
    assert not is_borne(seen(folded), folded)


def test_what_hangs_from_hands_is_not(cloth):
    x, y, _ = cloth.T
    sagging = np.stack([0.95 * x, y, 0.3 - 0.05 * (1 - (x / 0.2) ** 2)], -1)
    ends = sagging[np.abs(x) > 0.19]
    assert not is_borne(seen(sagging, ends), sagging)
    hanging = np.stack([x, 0.02 * np.sin(30 * x), y + 0.3], -1)
    assert not is_borne(seen(hanging, hanging[y > 0.14]), hanging)
    wavy = np.stack([x, y, 0.3 + 0.01 * np.sin(40 * x)], -1)
    assert not is_borne(seen(wavy, wavy[np.abs(x) > 0.19]), wavy)


def test_a_cloth_that_hangs_over_its_own_taut_fold_between_two_hands_is_not(cloth):
    # a round ridge along x, its ends in the hands, and two sides that hang down
    x, y, _ = cloth.T
    ridge, radius = 0.4 - 0.02 * (1 - (x / 0.2) ** 2), 0.06
    angle = np.clip(y / radius, -1.2, 1.2)
    beyond = (np.abs(y) - 1.2 * radius).clip(0.0)
    across = radius * np.sin(angle) + np.sign(y) * np.cos(1.2) * beyond
    roof = np.stack([x, across, ridge - radius * (1 - np.cos(angle)) - np.sin(1.2) * beyond], -1)
    ends = roof[(np.abs(x) > 0.19) & (np.abs(y) < 0.03)]
    for hands in (ends, np.concatenate([ends, ends + 0.004])):
        assert not is_borne(seen(roof, hands), roof)
    # held by nobody it would have to stand
    assert is_borne(seen(roof, [[0.0, 0.0, 2.0]]), roof)


def test_a_cloth_that_a_hand_holds_by_its_middle_hangs_from_it(cloth):
    x, y, _ = cloth.T
    away = np.hypot(x, y)
    draped = np.stack([0.4 * x, 0.4 * y, 0.3 - 0.9 * np.maximum(away - 0.02, 0.0)], -1)
    assert not is_borne(seen(draped, [[0.0, 0.0, 0.3]]), draped)


def test_without_a_weight_nothing_is_known_either(half):
    assert not is_borne(replace(seen(half), gravity=(0.0, 0.0, 0.0)), half)


def test_without_a_ground_nothing_is_known_of_what_bears(half):
    assert not is_borne(seen(half, ground=None), half)
