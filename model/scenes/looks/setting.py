"""Where a scene is filmed: table, room, lamp, and the sensor behind the lens."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float, Float32, UInt8

from model.backdrops import LEAN, shade
from model.scenes.looks.light import Light
from model.scenes.table import room_view, table_view
from model.types import Array, Camera

TABLES = (
    (0.37, 0.41, 0.47), (0.66, 0.53, 0.38), (0.78, 0.77, 0.74), (0.20, 0.20, 0.22),
    (0.22, 0.40, 0.36), (0.55, 0.53, 0.50), (0.42, 0.31, 0.24),
)  # fmt: skip
"""Laminate, beech, white, black, a cutting mat, stone, walnut."""
ROOMS = ((0.17, 0.165, 0.16), (0.34, 0.33, 0.31), (0.24, 0.27, 0.30), (0.45, 0.44, 0.42))


@dataclass(frozen=True)
class Sensor:
    """What a phone's camera adds to a picture."""

    noise: float
    """Standard deviation in the dark, over the full range."""
    shot: float
    """Added to it in full light."""
    blur: float
    """Of the lens [px]."""
    vignette: float
    """How much darker the corners are."""
    balance: tuple[float, float, float]
    """Gain per channel."""

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "Sensor":
        """One of many phones."""
        gains = 1 + rng.normal(0, 0.02, 3)
        return cls(
            noise=float(rng.uniform(0.8, 2.2) / 255),
            shot=float(rng.uniform(0.5, 2.0) / 255),
            blur=float(rng.uniform(0.2, 0.7)),
            vignette=float(rng.uniform(0.0, 0.18)),
            balance=(float(gains[0]), float(gains[1]), float(gains[2])),
        )

    def expose(self, picture: Float[Array, "H W 3"], rng: np.random.Generator) -> UInt8[Array, "H W 3"]:
        """The picture as it is read out."""
        height, width = picture.shape[:2]
        y, x = np.mgrid[:height, :width]
        off = np.hypot((x + 0.5) / width - 0.5, (y + 0.5) / height - 0.5) / np.sqrt(0.5)
        seen = cv2.GaussianBlur(picture.astype(np.float64), (0, 0), self.blur)
        seen = seen * (1 - self.vignette * off**2)[..., None] * np.array(self.balance)
        spread = self.noise + self.shot * np.sqrt(np.clip(seen, 0, 1))
        noisy = np.clip(seen + spread * rng.normal(size=seen.shape), 0, 1)
        exposed: UInt8[Array, "H W 3"] = (noisy * 255 + 0.5).astype(np.uint8)
        return exposed


@dataclass(frozen=True)
class Setting:
    """A room with a lamp, and a table at the height of the ground, where there is one."""

    light: Light
    table: tuple[float, float, float]
    room: tuple[float, float, float]
    sensor: Sensor

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "Setting":
        """One of many rooms."""
        table = np.clip(np.array(TABLES[int(rng.integers(len(TABLES)))]) * rng.uniform(0.85, 1.12), 0, 0.9)
        room = np.array(ROOMS[int(rng.integers(len(ROOMS)))])
        return cls(
            light=Light.draw(rng),
            table=(float(table[0]), float(table[1]), float(table[2])),
            room=(float(room[0]), float(room[1]), float(room[2])),
            sensor=Sensor.draw(rng),
        )

    def empty(
        self,
        camera: Camera,
        middle: Float[Array, " 3"],
        ground_height: float | None,
        rng: np.random.Generator,
    ) -> tuple[Float32[Array, "H W 3"], Float32[Array, "H W"]]:
        """What the camera sees of it without anything in it, and where the table is (0..1).

        Args:
            camera: Looks at it.
            middle: What stands in the middle of the table [m].
            ground_height: Of the table [m]; None: there is none.
            rng: For textures.
        """
        if ground_height is None:
            room = room_view(camera, rng, np.array(self.room)).clip(0, 1).astype(np.float32)
            return room, np.zeros(room.shape[:2], np.float32)
        forward = camera.forward
        spot = np.array([middle[0], middle[1], ground_height])
        turned = _moved(camera, np.pi / 2 - float(np.arctan2(forward[1], forward[0])), spot)
        return table_view(turned, rng, np.array(self.table), np.array(self.room))

    def shaded(
        self,
        background: Float32[Array, "H W 3"],
        on_table: Float32[Array, "H W"],
        means: Float32[Array, "G 3"],
        volumes: Float32[Array, " G"],
        ground_height: float | None,
        camera: Camera,
    ) -> Float32[Array, "H W 3"]:
        """The empty setting with the shadow of Gaussians on its table, away from the lamp."""
        if ground_height is None:
            return background
        towards = self.light.towards
        angle = float(np.arctan2(-LEAN[1], -LEAN[0]) - np.arctan2(towards[1], towards[0]))
        origin = np.zeros(3)
        turned = (means.astype(np.float64) @ _turn(angle).T).astype(np.float32)
        shadowed = shade(background, turned, volumes, ground_height, _moved(camera, angle, origin))
        lain: Float32[Array, "H W 3"] = background + on_table[..., None] * (shadowed - background)
        return lain


def _moved(camera: Camera, angle: float, spot: Float[Array, " 3"]) -> Camera:
    """The camera in a world turned about z, with `spot` as its origin."""
    pose = camera.world_from_camera.copy()
    pose[:3, 3] -= spot
    pose[:3] = _turn(angle) @ pose[:3]
    return replace(camera, world_from_camera=pose)


def _turn(angle: float) -> Float[Array, "3 3"]:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
