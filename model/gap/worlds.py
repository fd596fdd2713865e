"""Random worlds of our own simulator, on other lattices than a diagnosis uses, to learn and to test on."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float64
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from model.gap.bodies.body import body_of
from model.gap.bodies.guess import Shape
from model.gap.bodies.neighbours import farthest_points
from model.gap.effects import ALL_EFFECTS
from model.gap.effects.base import Effect
from model.gap.plain import PlainTwin
from model.simulator.divergence import SimulationDiverged
from model.types import Array, Observation

POINTS, FRAMES, FPS = 180, 136, 30.0
"""What is seen of a world."""


@dataclass(frozen=True)
class Made:
    """A world that was simulated, and what was put into it."""

    observation: Observation
    effects: tuple[str, ...]
    shape: Shape
    amplitude: float
    """Mean distance between motion with and without the effects [m]."""


def make_world(seed: int, effects: tuple[type[Effect], ...] = ()) -> Made | None:
    """A random object, handled at random, with these effects; None where they cannot act or it diverges.

    The lattice, the parameters, the noise and what is hidden are random too.
    """
    rng = np.random.default_rng(seed)
    shape: Shape = rng.choice(["rope", "sheet", "solid"])
    surface = _surface(shape, rng)
    hands, ground = _handled(surface, shape, rng)
    still = Observation(
        times=np.arange(FRAMES) / FPS,
        points=np.repeat(surface[None].astype(np.float32), FRAMES, axis=0),
        controllers=hands.astype(np.float32),
        ground_height=ground,
    )
    twin = PlainTwin.of(body_of(still, shape, scale=rng.uniform(0.7, 0.9)), still)
    values = {
        name: _drawn(name, quantity.bounds, quantity.start, rng) for name, quantity in twin.quantities.items()
    }
    plain = twin.world({name: torch.tensor(value, dtype=torch.float64) for name, value in values.items()})
    world = plain
    for kind in effects:
        effect = kind()
        if effect.unable(world):
            return None
        drawn = {
            name: torch.tensor(_drawn(name, q.bounds, q.start, rng), dtype=torch.float64)
            for name, q in effect.quantities.items()
        }
        world = effect.apply(world, drawn)
    try:
        with torch.no_grad():
            true = world.sight(world.rollout().points).double().numpy()
            without = plain.sight(plain.rollout().points).double().numpy()
    except SimulationDiverged:
        return None
    gap = float(np.linalg.norm(true - without, axis=-1).mean())
    seen = _seen(replace(still, points=true.astype(np.float32)), rng)
    return Made(seen, tuple(kind.name for kind in effects), shape, gap)


def random_effects(rng: np.random.Generator) -> tuple[type[Effect], ...]:
    """None for a third of all worlds, two for a sixth."""
    count = int(rng.choice([0, 1, 2], p=[0.33, 0.5, 0.17]))
    chosen = rng.choice(len(ALL_EFFECTS), size=count, replace=False)
    return tuple(ALL_EFFECTS[int(i)] for i in chosen)


def _drawn(name: str, bounds: tuple[float, float], start: float, rng: np.random.Generator) -> float:
    """Around where fits start, wide."""
    low, high = bounds
    if low > 0 and high / low > 20:
        return float(np.clip(start * np.exp(rng.normal(0.0, 1.0)), low, high))
    return float(np.clip(rng.normal(start, 0.15 * (high - low)), low, high))


def _surface(shape: Shape, rng: np.random.Generator) -> Float64[Array, "N 3"]:
    """Points on an object somewhere above the ground, in any direction about the vertical."""
    size = rng.uniform(0.2, 0.45)
    if shape == "rope":
        s = np.linspace(0, 1, POINTS)
        bend = rng.normal(0, 0.12, 2)
        line = np.stack([s, bend[0] * np.sin(np.pi * s), bend[1] * np.sin(2 * np.pi * s)], -1) * 1.6 * size
        angle = rng.uniform(0, 2 * np.pi, POINTS)
        radius = rng.uniform(0.005, 0.012)
        places = line + radius * np.stack([0 * s, np.cos(angle), np.sin(angle)], -1)
    elif shape == "sheet":
        u, v = _jittered(size, size * rng.uniform(0.6, 1.0), rng)
        places = np.stack([u, v, 0.03 * np.sin(6 * u / size) * rng.normal()], -1)
        if rng.random() < 0.5:
            places = places[:, [0, 2, 1]]
    else:
        sides = size * np.array([1.0, rng.uniform(0.35, 0.8), rng.uniform(0.3, 0.7)])
        cloud = rng.uniform(-0.5, 0.5, (6000, 3))
        if rng.random() < 0.5:  # an ellipsoid
            cloud = 0.5 * cloud / np.linalg.norm(cloud, axis=1, keepdims=True)
        else:  # a box
            side = np.argmax(np.abs(cloud), axis=1)
            rows = np.arange(len(cloud))
            cloud[rows, side] = 0.5 * np.sign(cloud[rows, side])
        places = cloud * sides
        apart = 0.9 * np.sqrt(2 * (sides[0] * sides[1] + sides[1] * sides[2] + sides[0] * sides[2]) / POINTS)
        while len(kept := farthest_points(places, apart)) < POINTS:
            apart *= 0.97
        places = places[rng.permutation(kept)[:POINTS]]
    turn = Rotation.from_euler("z", rng.uniform(0, 360), degrees=True)
    middle = np.array([*rng.normal(0, 0.3, 2), rng.uniform(0.5, 1.0)])
    placed: Float64[Array, "N 3"] = turn.apply(places - places.mean(0)) + middle
    return placed


def _jittered(width: float, height: float, rng: np.random.Generator) -> tuple[Array, Array]:
    columns = int(np.ceil(np.sqrt(POINTS * width / height)))
    rows = int(np.ceil(POINTS / columns))
    index = np.arange(POINTS)
    grid = np.stack([index // rows, index % rows], -1) + rng.uniform(-0.25, 0.25, (POINTS, 2))
    return grid[:, 0] * width / columns, grid[:, 1] * height / rows


def _handled(
    places: Float64[Array, "N 3"], shape: Shape, rng: np.random.Generator
) -> tuple[Float64[Array, "T C 3"], float | None]:
    """What one or two hands do, and how high the ground is."""
    times = np.arange(FRAMES) / FPS
    count = int(rng.integers(1, 3))
    axis = np.linalg.svd(places - places.mean(0), full_matrices=False)[2][0]
    along = (places - places.mean(0)) @ axis
    ends = [places[along.argmax()], places[along.argmin()]][:count]
    hands = []
    for place in ends:
        near = places[np.argsort(np.linalg.norm(places - place, axis=1))[: int(rng.integers(4, 9))]]
        knots = np.linspace(0, times[-1], int(rng.integers(4, 8)))
        still = rng.random(len(knots)) < 0.3
        steps = np.where(still[:, None], 0.0, rng.normal(0, 1, (len(knots), 3)) * rng.uniform(0.03, 0.15))
        steps[0] = 0.0
        moved = CubicSpline(knots, steps.cumsum(0), bc_type="clamped")(times)
        if rng.random() < 0.4:
            moved += rng.uniform(0.01, 0.05) * np.sin(2 * np.pi * rng.uniform(1, 3) * times)[:, None] * axis
        moved *= np.clip(times / 0.3, 0, 1)[:, None]
        hands.append(near[None] + moved[:, None])
    resting = rng.random() < 0.5
    low = float(places[:, 2].min())
    ground = low - 0.002 if resting else (low - 0.3 if rng.random() < 0.5 else None)
    return np.concatenate(hands, 1), ground


def _seen(true: Observation, rng: np.random.Generator) -> Observation:
    """With noise that is correlated in time, hidden points, and an error of scale."""
    points = true.points.astype(np.float64)
    noise = rng.uniform(0.0005, 0.003)
    white = rng.normal(0, noise, points.shape)
    kept = rng.uniform(0.0, 0.8)
    for t in range(1, len(white)):
        white[t] = kept * white[t - 1] + np.sqrt(1 - kept**2) * white[t]
    points = points + white
    for i in np.flatnonzero(rng.random(points.shape[1]) < 0.3):
        begin = int(rng.integers(1, len(points)))
        points[begin : begin + int(rng.integers(5, 50)), i] = np.nan
    scale = 1.0 + rng.normal(0, 0.005)
    hands = true.controllers + rng.normal(0, rng.uniform(0, 0.001), true.controllers.shape)
    hands[0] = true.controllers[0]
    middle = points[0].mean(0) if np.isfinite(points[0]).all() else np.nanmean(points[0], 0)
    points = middle + scale * (points - middle)
    return replace(true, points=points.astype(np.float32), controllers=hands.astype(np.float32))
