"""Which worlds there are, drawn by seed and index alone: nothing but what moves tells one label from another.

Twenty worlds make a block: six without anything missing, seven with one effect of the catalogue, three with
two, two with one from outside of it, one with a camera that errs, and one whose hands or mesh do. Object and
interaction of a world with nothing missing are drawn as if for an effect, so that they tell nothing.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from benchmarks.reality import shapes
from benchmarks.reality.effects import ALL, CATALOGUE, OUTSIDE
from benchmarks.reality.hands import SCRIPTS, rotation, stage
from benchmarks.reality.sensor import Sensor, draw_sensor
from benchmarks.reality.shapes import Shape
from benchmarks.reality.world import Kind, Material, World

Split = Literal["dev", "test"]
Category = Literal["null", "single", "pair", "outside", "perception", "actuation", "topology"]
BLOCK: tuple[Category, ...] = (
    ("null",) * 6 + ("single",) * 7 + ("pair",) * 3 + ("outside",) * 2 + ("perception",)
)
LAST: tuple[Category, ...] = ("actuation", "topology")
MAGNITUDES = (0.5, 1.0, 2.0, 2.0, 4.0, 4.0)
"""Targets; the larger ones are often out of reach, and it is from 2 on that the scores count."""
FPS = 30.0
BENDING = 2e-4
"""A bending length of 2.3 cm at 0.4 m, as of cotton. Without any, a ten-thousandth more stiffness was seen
to move a cloth by 14 mm on average; with it, by a hundredth of a millimetre."""
SPLITS: Mapping[Split, int] = {"dev": 11, "test": 97}

Make = Callable[[np.random.Generator, int], Shape]
OBJECTS: Mapping[Split, Mapping[Kind, tuple[Make, ...]]] = {
    "dev": {
        "rope": (lambda r, n: shapes.rope(r, n, False),),
        "sheet": (lambda r, n: shapes.sheet(r, n, "rectangle"),),
        "solid": tuple(
            (lambda r, n, name=name: shapes.block(r, n, name)) for name in ("box", "L block", "T block")
        ),
    },
    "test": {
        "rope": (lambda r, n: shapes.rope(r, n, True),),
        "sheet": tuple(
            (lambda r, n, o=o: shapes.sheet(r, n, o)) for o in ("ellipse", "trapezium", "notched")
        ),
        "solid": (
            shapes.plush,
            shapes.plush,
            *(
                (lambda r, n, name=name: shapes.round_solid(r, n, name))
                for name in ("cylinder", "wedge", "ring")
            ),
        ),
    },
}


@dataclass(frozen=True)
class Recipe:
    """All that is drawn before anything moves."""

    category: Category
    world: World
    transfer: World
    names: tuple[str, ...]
    """Effects to be tuned; none for a world that misses nothing."""
    target: float
    sensor: Sensor
    transfer_sensor: Sensor
    note: str = ""
    """What is odd about the camera, the hands or the mesh."""


def category_of(seed: int, split: Split, index: int) -> Category:
    """The category of a world; each block of twenty holds all in their shares."""
    block = index // 20
    rng = np.random.default_rng([SPLITS[split], seed, 1, block])
    order = rng.permutation([*BLOCK, LAST[block % 2]])
    return order[index % 20]


@dataclass(frozen=True)
class Wanted:
    """What development may ask for instead of a block's shares, in which clear effects are rare."""

    categories: tuple[Category, ...] = ()
    """One of these; none: as the block says."""
    targets: tuple[float, ...] = MAGNITUDES


def draw_recipe(
    seed: int, split: Split, index: int, attempt: int = 0, wanted: Wanted | None = None
) -> Recipe:
    """The recipe of a world; `attempt` counts those thrown away because their effect could not be seen."""
    wanted = wanted or Wanted()
    category = category_of(seed, split, index)
    if wanted.categories:
        category = wanted.categories[index % len(wanted.categories)]
    rng = np.random.default_rng([SPLITS[split], seed, 2, index, attempt])
    names = _names(category, seed, split, index, attempt, rng)
    kinds = [kind for kind in ("rope", "sheet", "solid") if all(kind in ALL[name].kinds for name in names)]
    kind: Kind = kinds[rng.integers(len(kinds))]
    fitting = [
        script
        for script in SCRIPTS
        if kind in SCRIPTS[script].kinds and all(script in ALL[name].excited_by for name in names)
    ]
    if category == "actuation":  # what errs must be there
        fitting = [script for script in fitting if script != "drop"] or ["lift"]
    first = fitting[rng.integers(len(fitting))]
    others = [script for script in fitting if script != first] or [
        s for s in SCRIPTS if kind in SCRIPTS[s].kinds and s != first
    ]
    second = others[rng.integers(len(others))]
    note = _note(category, split, kind, rng)
    makes = OBJECTS[split][kind]
    make = makes[rng.integers(len(makes))] if note != "slit" else (lambda r, n: shapes.sheet(r, n, "slit"))
    shape = make(rng, int(rng.integers(120, 241)))
    times = np.arange(int(rng.integers(122, 151))) / FPS
    turn = rotation(np.array([0, 0, rng.uniform(-np.pi, np.pi)]))
    shift = np.array([*rng.uniform(-0.2, 0.2, 2), 0.0])
    material = draw_material(shape, rng)
    spacing = _spacing(split, shape) * (1.9 if note == "coarse" else 1.0)
    world = World(
        shape, material, stage(first, shape, times, turn, shift, rng), (), spacing, int(rng.integers(1 << 30))
    )
    other_times = np.arange(int(rng.integers(122, 151))) / FPS
    transfer = replace(world, scene=stage(second, shape, other_times, turn, shift, rng))
    sensor = _sensor(note, rng)
    again = replace(
        draw_sensor(rng),
        scale=sensor.scale,
        stretch=sensor.stretch,
        gain=sensor.gain,
        lag=sensor.lag,
        camera=sensor.camera,
        noise=sensor.noise,
    )
    missing = names if category in ("single", "pair", "outside") else ()
    target = _target(seed, split, index, wanted.targets)
    return Recipe(category, world, transfer, missing, target, sensor, again, note)


def _target(seed: int, split: Split, index: int, targets: tuple[float, ...]) -> float:
    """The same in every attempt: else those that are easy to reach would be left."""
    return float(np.random.default_rng([SPLITS[split], seed, 5, index]).choice(targets))


def _spacing(split: Split, shape: Shape) -> float:
    """Between nodes [m]: as fine as a simulation of a second allows."""
    if split == "test":
        return {"rope": 0.012, "sheet": shape.length / 17, "solid": 0.022}[shape.kind]
    return {"rope": 0.015, "sheet": shape.length / 14, "solid": 0.028}[shape.kind]


def _names(
    category: Category, seed: int, split: Split, index: int, attempt: int, rng: np.random.Generator
) -> tuple[str, ...]:
    """The effects; for a world without any, those that its object and interaction are drawn for."""
    source = OUTSIDE if category == "outside" else CATALOGUE
    order = np.random.default_rng([SPLITS[split], seed, 3, index // 20]).permutation(list(source))
    # Worlds of a block go through the names in an order of their own, so that all appear about equally often.
    first = str(order[(index * 7 + index // 20 * 5 + (attempt >= 6)) % len(order)])
    if category != "pair":
        return (first,)
    partners = [
        name
        for name in CATALOGUE
        if name != first
        and set(ALL[name].kinds) & set(ALL[first].kinds)
        and set(ALL[name].excited_by) & set(ALL[first].excited_by)
        and {name, first} != {"wind", "quadratic_air_drag"}
        and _some_script(name, first)
    ]
    return first, str(partners[rng.integers(len(partners))])


def _some_script(first: str, second: str) -> bool:
    kinds = set(ALL[first].kinds) & set(ALL[second].kinds)
    scripts = set(ALL[first].excited_by) & set(ALL[second].excited_by)
    return all(any(kind in SCRIPTS[script].kinds for script in scripts) for kind in kinds)


def draw_material(shape: Shape, rng: np.random.Generator) -> Material:
    """Soft enough to sag by a few per cent of its size under its own weight."""
    sag = float(np.exp(rng.uniform(np.log(0.008), np.log(0.04))))
    density = {
        "rope": rng.uniform(0.04, 0.2),
        "sheet": rng.uniform(0.15, 0.5),
        "solid": rng.uniform(90, 350),
    }[shape.kind]
    length = shape.length if shape.kind != "solid" else 0.5 * shape.length
    young = density * 9.81 * length / sag
    ratio = float(np.exp(rng.uniform(-0.3, 0.3))) if rng.random() < 0.5 else 1.0
    return Material(
        density=density,
        stiffness=(young, young * ratio),
        poisson={"rope": 0.0, "sheet": rng.uniform(0.28, 0.36), "solid": rng.uniform(0.2, 0.28)}[shape.kind],
        damping=float(np.exp(rng.uniform(np.log(2e-4), np.log(1.2e-3)))),
        drag_rate=rng.uniform(0.3, 2.0),
        friction=rng.uniform(0.25, 0.8),
        restitution=rng.uniform(0.0, 0.4),
        bending=BENDING if shape.kind == "sheet" else 0.0,
    )


def _note(category: Category, split: Split, kind: Kind, rng: np.random.Generator) -> str:
    if category == "perception":
        return str(rng.choice(["scale", "drift", "depth"]))
    if category == "actuation":
        return str(rng.choice(["lag", "jitter", "gain"]))
    if category == "topology":
        return "slit" if kind == "sheet" and split == "test" and rng.random() < 0.5 else "coarse"
    return ""


def _sensor(note: str, rng: np.random.Generator) -> Sensor:
    sensor = draw_sensor(rng)
    sign = float(rng.choice([-1, 1]))
    odd: Mapping[str, Mapping[str, float]] = {
        "scale": {"scale": 1 + sign * rng.uniform(0.05, 0.09)},
        "drift": {"drift": rng.uniform(0.01, 0.03)},
        "depth": {"stretch": 1 + sign * rng.uniform(0.06, 0.12)},
        "lag": {"lag": rng.uniform(0.05, 0.15)},
        "jitter": {"jitter": rng.uniform(0.006, 0.014), "jitter_memory": 0.9},
        "gain": {"gain": 1 + sign * rng.uniform(0.1, 0.2)},
    }
    return replace(sensor, **odd.get(note, {}))
