"""Random worlds of our own simulator, on other lattices than a diagnosis uses, to learn and to test on."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float64
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from model.gap.bodies.body import Body, body_of
from model.gap.bodies.guess import Shape
from model.gap.bodies.neighbours import farthest_points
from model.gap.effects import ALL_EFFECTS
from model.gap.effects.base import Effect
from model.gap.observer import Observer
from model.gap.plain import PlainTwin
from model.gap.study import PATIENCE
from model.gap.world import World
from model.simulator.divergence import SimulationDiverged
from model.simulator.system import State
from model.types import Array, Observation

POINTS, FRAMES, FPS = 180, 136, 30.0
"""What is seen of a world."""
SETTLING = 20
"""Frames between stops, of an object that comes to rest."""
RESTING = {"prestress": 1.0}
TRIES = 5
"""Sizes of an effect that are tried."""
INNOVATION_NOISE = 0.002
"""Of a usual recording [m]."""


@dataclass(frozen=True)
class Made:
    """A world that was simulated, and what was put into it."""

    observation: Observation
    effects: tuple[str, ...]
    shape: Shape
    amplitude: float
    """Mean distance between motion with and without the effects [m]."""
    ratio: float
    """Innovations by the effects over those by noise and another lattice."""


def make_world(seed: int, effects: tuple[type[Effect], ...] = ()) -> Made | None:
    """A random object, handled at random, with these effects; None where they cannot act or it diverges.

    The lattice, the parameters, how large the effects are, the noise and what is hidden are random too. The
    object starts at rest, hanging or lying as it does in the hands that hold it, or as it was placed.
    """
    rng = np.random.default_rng(seed)
    try:
        with torch.no_grad():
            return _made(rng, effects)
    except SimulationDiverged:
        return None


def _made(rng: np.random.Generator, effects: tuple[type[Effect], ...]) -> Made | None:
    shape: Shape = rng.choice(["rope", "sheet", "solid"])
    surface = _surface(shape, rng)
    hands, ground = _handled(surface, shape, rng)
    still = Observation(
        times=np.arange(FRAMES) / FPS,
        points=np.repeat(surface[None].astype(np.float32), FRAMES, axis=0),
        controllers=hands.astype(np.float32),
        ground_height=ground,
    )
    fine = rng.uniform(0.7, 0.9) if rng.random() < 0.7 else rng.uniform(1.1, 1.25)
    twin = PlainTwin.of(_thinned(body_of(still, shape, scale=fine), rng), still)
    values = {
        name: _drawn(name, quantity.bounds, quantity.start, rng) for name, quantity in twin.quantities.items()
    }
    settled = bool(rng.random() < 0.6)
    values["prestress"] = rng.uniform(0.0, 0.3) if settled else rng.uniform(0.85, 1.1)
    plain = twin.world({name: torch.tensor(value, dtype=torch.float64) for name, value in values.items()})
    start = _settled(plain) if settled else None
    base = plain.sight(plain.rollout(start).points).double().numpy()
    true, ratio = base, 0.0
    if effects:
        found = _enlarged(plain, start, base, effects, still, shape, values, rng)
        if found is None:
            return None
        true, ratio = found
    gap = float(np.linalg.norm(true - base, axis=-1).mean())
    seen = _seen(replace(still, points=true.astype(np.float32)), rng)
    return Made(seen, tuple(kind.name for kind in effects), shape, gap, ratio)


def _thinned(body: Body, rng: np.random.Generator) -> Body:
    """Without some of its springs, so that no other lattice is quite like it."""
    if body.shape == "rope":
        return body
    kept = rng.random(len(body.springs)) > rng.uniform(0.0, 0.15)
    ends = np.bincount(body.springs[kept].ravel(), minlength=len(body.points))
    poor = (ends < 6)[body.springs].any(1)
    return replace(body, springs=body.springs[kept | poor])


def _settled(world: World) -> State:
    """At rest in the hands or on the ground."""
    controls = None if world.controls is None else world.controls[:1].expand(SETTLING, -1, -1)
    still = replace(world, times=np.arange(SETTLING) / FPS, controls=controls)
    places = world.system.points
    for _ in range(8):  # stopped now and then, it comes to rest soon
        places = still.rollout(State(places, torch.zeros_like(places), {})).points[-1]
    return State(places, torch.zeros_like(places), {})


def _enlarged(
    plain: World,
    start: State | None,
    base: Float64[Array, "T N 3"],
    effects: tuple[type[Effect], ...],
    still: Observation,
    shape: Shape,
    values: dict[str, float],
    rng: np.random.Generator,
) -> tuple[Float64[Array, "T N 3"], float] | None:
    """Effects of a size that can be seen: a drawn multiple of what another lattice changes.

    The multiple is of innovations under an observer, so that what is chaotic does not count.
    """
    target = float(np.exp(rng.uniform(np.log(0.8), np.log(8.0))))
    seen = replace(still, points=base.astype(np.float32))
    other = PlainTwin.of(body_of(replace(still, points=base.astype(np.float32)), shape), seen)
    twin = other.world({n: torch.tensor(v, dtype=torch.float64) for n, v in (values | RESTING).items()})
    hidden = float(np.hypot(_innovation(twin, seen), INNOVATION_NOISE))
    drawn = []
    for kind in effects:
        effect = kind()
        if effect.unable(plain):
            return None
        drawn.append((effect, {n: _drawn(n, q.bounds, q.start, rng) for n, q in effect.quantities.items()}))
    size = 1.0
    best: tuple[float, Float64[Array, "T N 3"], float] | None = None
    for _ in range(TRIES):
        world = plain
        for effect, values_ in drawn:
            scaled = {
                n: torch.tensor(_scaled(effect, n, v, size), dtype=torch.float64) for n, v in values_.items()
            }
            world = effect.apply(world, scaled)
        try:
            true = world.sight(world.rollout(start).points).double().numpy()
            moved = _innovation(plain, replace(still, points=true.astype(np.float32)), start)
        except SimulationDiverged:
            size *= 0.3
            continue
        ratio = moved / hidden
        off = abs(np.log(max(ratio, 1e-6) / target))
        if best is None or off < best[0]:
            best = off, true, ratio
        if off < 0.3:
            break
        size *= float(np.clip(target / max(ratio, 1e-6), 0.05, 20.0))
    if best is None or best[2] < 0.4:
        return None
    return best[1], best[2]


def _scaled(effect: Effect, name: str, value: float, size: float) -> float:
    """A quantity of the effect made larger, within bounds."""
    if name not in effect.absent:
        return value
    low, high = effect.quantities[name].bounds
    return float(np.clip(value * size, low, high))


def _innovation(world: World, seen: Observation, start: State | None = None) -> float:
    """Root mean square of what an observer has to correct [m]."""
    observer = Observer(seen, world, PATIENCE)
    error = observer.lead(world, start).predicted - observer.places
    return float(error.square().mean().sqrt())


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
    """What one or two hands do, and how high the ground is.

    Two hands move together, and a little against each other: nobody wrings an object beyond recognition.
    """
    times = np.arange(FRAMES) / FPS
    count = int(rng.integers(1, 3))
    axis = np.linalg.svd(places - places.mean(0), full_matrices=False)[2][0]
    along = (places - places.mean(0)) @ axis
    ends = [places[along.argmax()], places[along.argmin()]][:count]
    common = _wandering(times, rng.uniform(0.03, 0.15), rng)
    if rng.random() < 0.4:
        direction = axis if rng.random() < 0.5 else rng.normal(size=3) / 1.7
        shaken = np.sin(2 * np.pi * rng.uniform(1, 3) * times) * np.clip(times / 0.3, 0, 1)
        common += rng.uniform(0.01, 0.05) * shaken[:, None] * direction
    apart = float(np.ptp(along))
    hands = []
    for side, place in zip((1.0, -1.0), ends, strict=False):
        near = places[np.argsort(np.linalg.norm(places - place, axis=1))[: int(rng.integers(4, 9))]]
        own = common.copy()
        if count == 2:
            slack = {"rope": 0.3, "sheet": 0.25, "solid": 0.06}[shape]
            inward = _wandering(times, 1.0, rng)[:, 0]
            inward = np.clip(inward / max(1.0, np.abs(inward).max()), -0.3, 1.0)
            own += -side * 0.5 * slack * apart * inward[:, None] * axis
            own += 0.3 * slack * apart * _wandering(times, 0.2, rng)
        turn = Rotation.from_rotvec(_wandering(times, rng.uniform(0.0, 0.25), rng))
        middle = near.mean(0)
        carried = np.stack([turn[t].apply(near - middle) for t in range(FRAMES)])
        hands.append(middle + carried + own[:, None])
    resting = rng.random() < 0.5
    low = float(places[:, 2].min())
    ground = low - 0.002 if resting else (low - 0.3 if rng.random() < 0.5 else None)
    return np.concatenate(hands, 1), ground


def _wandering(times: Float64[Array, " T"], size: float, rng: np.random.Generator) -> Float64[Array, "T 3"]:
    """A smooth path from zero that rests now and then; steps of about `size`."""
    knots = np.linspace(0, times[-1], int(rng.integers(4, 8)))
    still = rng.random(len(knots)) < 0.3
    steps = np.where(still[:, None], 0.0, rng.normal(0, size, (len(knots), 3)))
    steps[0] = 0.0
    path: Float64[Array, "T 3"] = CubicSpline(knots, steps.cumsum(0), bc_type="clamped")(times)
    return path


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
