import cv2
import numpy as np
import pytest

from model.types import Frames


def scene(count=12, *, height=120, width=200, hand=True, thing=True, seed=0):
    """A patterned soft thing on a plain table, pushed to the right by a skin-coloured arm from above."""
    rng = np.random.default_rng(seed)
    table = (
        np.full((height, width, 3), (206, 198, 186), np.float32) + np.linspace(0, 12, width)[None, :, None]
    )
    pattern = cv2.resize(
        rng.integers(0, 2, (8, 8, 3)).astype(np.float32), (60, 44), interpolation=cv2.INTER_NEAREST
    )
    images = np.empty((count, height, width, 3), np.uint8)
    objects, hands = np.zeros((2, count, height, width), bool)
    for index in range(count):
        image, x = table.copy(), 76 + 2 * index
        mask = np.zeros((height, width), np.uint8)
        if thing:
            cv2.ellipse(mask, (x, 74), (26, 18), 0, 0, 360, 1, -1)
            tile = np.zeros_like(image)
            tile[52:96, x - 30 : x + 30] = (40, 90, 150) + 60 * pattern
            image = np.where(mask[..., None] > 0, tile, image)
        arm = np.zeros((height, width), np.uint8)
        if hand:
            cv2.line(arm, (x - 46, 0), (x - 34, 70), 1, 13)
            arm[mask > 0] = 0
            image = np.where(arm[..., None] > 0, np.array([176, 118, 98], np.float32), image)
        image += rng.normal(0, 1.5, image.shape)
        images[index] = np.clip(cv2.GaussianBlur(image, (0, 0), 0.6), 0, 255)
        objects[index], hands[index] = mask > 0, arm > 0
    return Frames(images, np.arange(count) / 30, "scene", "0" * 64), objects, hands


@pytest.fixture(scope="session")
def make_scene():
    return scene
