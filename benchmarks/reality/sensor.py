"""What cameras report of a motion (noise, losses, drift, a wrong scale), and what the log of a hand says."""

from dataclasses import dataclass

import numpy as np

from benchmarks.reality.hands import follow
from benchmarks.reality.world import RATE, Array, Hand, Scene

HELD_POINTS = (4, 9)
"""Fewest and most controllers per hand."""


@dataclass(frozen=True)
class Sensor:
    """The errors of one set-up. Everything is drawn anew for each recording, apart from the scale."""

    noise: float
    """Standard deviation of a coordinate [m]."""
    memory: float
    """Correlation of the noise from frame to frame."""
    scale: float
    """Reported over true size, about the foot of the camera."""
    drift: float
    """How far the frame of reference wanders [m]."""
    stretch: float
    """Reported over true distance along the line of sight, about the middle of the scene."""
    jitter: float
    """Of the controllers [m]."""
    jitter_memory: float
    gain: float
    """Reported over true travel of the hands."""
    lag: float
    """Time [s] after which the true hand follows what was commanded and is reported."""
    losses: float
    """Share of the frames in which a point is lost."""
    camera: tuple[float, float, float]
    """Where it stands [m]."""


def draw_sensor(rng: np.random.Generator) -> Sensor:
    """An ordinary set-up: the nuisances of GAP.md."""
    angle, distance = rng.uniform(0, 2 * np.pi), rng.uniform(1.0, 1.6)
    return Sensor(
        noise=float(np.exp(rng.uniform(np.log(0.001), np.log(0.005)))),
        memory=rng.uniform(0.2, 0.85),
        scale=1.0 + rng.uniform(0.005, 0.02) * rng.choice([-1, 1]),
        drift=rng.uniform(0.0, 0.003),
        stretch=1.0,
        jitter=rng.uniform(0.0005, 0.002),
        jitter_memory=rng.uniform(0.2, 0.8),
        gain=1.0,
        lag=0.0,
        losses=rng.uniform(0.02, 0.15),
        camera=(distance * np.cos(angle), distance * np.sin(angle), rng.uniform(0.4, 1.0)),
    )


def wander(frames: int, shape: tuple[int, ...], memory: float, rng: np.random.Generator) -> Array:
    """Unit-variance noise [frames, *shape] with correlation `memory` between frames."""
    noise = rng.normal(size=(frames, *shape))
    fresh = np.sqrt(1 - memory**2)
    for t in range(1, frames):
        noise[t] = memory * noise[t - 1] + fresh * noise[t]
    return noise


def smooth_path(frames: int, rng: np.random.Generator) -> Array:
    """A slow path [frames, 3] from zero whose largest excursion is 1."""
    t = np.linspace(0, 1, frames)[:, None]
    path = sum(rng.normal(size=3) * np.sin(np.pi * (k * t + rng.uniform())) / k for k in (1, 2, 3))
    path = path - path[0]
    return path / np.linalg.norm(path, axis=1).max()


def report(points: Array, scene: Scene, sensor: Sensor, rng: np.random.Generator) -> dict[str, Array]:
    """The arrays of an observation (contract 3) of material points [T, N, 3]."""
    frames, count = points.shape[:2]
    camera = np.asarray(sensor.camera) + scene.shift * [1, 1, 0]
    controllers, centres = log_hands(scene, sensor, rng)
    hidden = _occluded(points, centres, camera) | _lost(frames, count, sensor.losses, rng)
    sight = points.mean(axis=(0, 1)) - camera
    sight /= np.linalg.norm(sight)
    independent = wander(frames, (count, 3), sensor.memory, rng)
    anchors = points[0, rng.integers(count, size=10)]
    patch = ((points[0][:, None] - anchors) ** 2).sum(axis=2).argmin(axis=1)
    common = wander(frames, (10, 3), sensor.memory, rng)[:, patch]
    noise = sensor.noise * (np.sqrt(0.7) * independent + np.sqrt(0.3) * common)
    noise += 0.5 * (noise @ sight)[..., None] * sight  # depth is the worst coordinate
    wandering = sensor.drift * smooth_path(frames, rng)[:, None]
    foot = camera * [1, 1, 0]

    def seen(true: Array) -> Array:
        middle = points[0].mean(axis=0)
        stretched = true + (sensor.stretch - 1) * ((true - middle) @ sight)[..., None] * sight
        return foot + sensor.scale * (stretched - foot) + wandering

    reported = seen(points) + noise
    reported[hidden] = np.nan
    arrays = {
        "times": scene.times.astype(np.float64),
        "points": reported.astype(np.float32),
        "controllers": seen(controllers).astype(np.float32),
        "gravity": np.asarray(scene.gravity),
    }
    if scene.ground is not None:
        arrays["ground_height"] = np.float64(scene.ground)
    return arrays


def log_hands(scene: Scene, sensor: Sensor, rng: np.random.Generator) -> tuple[Array, Array]:
    """Controllers [T, C, 3] as logged, before any camera, and the true centres of the hands [T, H, 3]."""
    frames = len(scene.times)
    place = np.clip(scene.times * RATE, 0, None)
    logs, centres = [], []
    for hand in scene.hands:
        count = int(rng.integers(*HELD_POINTS))
        own = hand.place + _ball(count, rng) * 0.8 * hand.reach
        said = Hand(hand.place, hand.reach, hand.offset * sensor.gain, hand.turn)
        logs.append(_at(follow(said, own), place))
        centres.append(_at(hand.place + hand.offset[:, None], place))
    if not logs:
        return np.zeros((frames, 0, 3)), np.zeros((frames, 0, 3))
    log = np.concatenate(logs, axis=1)
    together = wander(frames, (1, 3), sensor.jitter_memory, rng)
    each = wander(frames, (log.shape[1], 3), sensor.jitter_memory, rng)
    jitter = sensor.jitter * (np.sqrt(0.5) * together + np.sqrt(0.5) * each)
    return log + jitter, np.concatenate(centres, axis=1)


def lagging(scene: Scene, lag: float) -> Scene:
    """The scene with hands that follow their command like a first-order servo with this time constant [s]."""
    if lag <= 0:
        return scene
    keep = np.exp(-1 / (RATE * lag))

    def follow_up(path: Array) -> Array:
        late = np.zeros_like(path)
        for t in range(1, len(path)):
            late[t] = keep * late[t - 1] + (1 - keep) * path[t]
        return late

    hands = tuple(Hand(h.place, h.reach, follow_up(h.offset), follow_up(h.turn)) for h in scene.hands)
    return Scene(scene.times, hands, scene.turn, scene.shift, scene.ground, scene.gravity, scene.interaction)


def _ball(count: int, rng: np.random.Generator) -> Array:
    way = rng.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    return way * np.cbrt(rng.uniform(size=(count, 1)))


def _at(path: Array, place: Array) -> Array:
    low = np.minimum(place.astype(int), len(path) - 2)
    share = (place - low)[:, None, None]
    return (1 - share) * path[low] + share * path[low + 1]


def _occluded(points: Array, centres: Array, camera: Array, radius: float = 0.03) -> Array:
    """Points [T, N] behind a hand."""
    hidden = np.zeros(points.shape[:2], bool)
    ray = points - camera
    far = np.linalg.norm(ray, axis=2)
    ray = ray / far[..., None]
    for h in range(centres.shape[1]):
        to = centres[:, h][:, None] + np.array([0, 0, 0.02]) - camera
        along = (to * ray).sum(axis=2)
        aside = np.linalg.norm(to - along[..., None] * ray, axis=2)
        hidden |= (aside < radius) & (along < far + 0.01)
    return hidden


def _lost(frames: int, count: int, share: float, rng: np.random.Generator) -> Array:
    """Runs of loss [T, N] that add up to about `share` of everything."""
    lost = np.zeros((frames, count), bool)
    for _ in range(int(share * frames * count / 8)):
        start, point, length = rng.integers(1, frames), rng.integers(count), rng.geometric(1 / 8)
        lost[start : start + length, point] = True
    return lost
