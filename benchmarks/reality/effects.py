"""What may be withheld: names, where they can act, how they are drawn. The laws are each generator's own.

The seventeen of the catalogue, and others from outside of it. An amplitude is one number with a range; what
else an effect needs is drawn once, by lot, as its options.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.reality.shapes import Shape
from benchmarks.reality.world import Effect, Field, Kind

Options = dict[str, float | tuple[float, ...]]
Rng = np.random.Generator
EVERY: tuple[Kind, ...] = ("rope", "sheet", "solid")
PULLS = ("stretch", "staircase", "lift", "hang", "shake", "twist", "press", "fold")
AIRY = ("lift", "hang", "shake", "stretch", "staircase", "twist", "drop", "fold")
GROUNDED = ("drag", "lift", "fold", "drop", "press")


@dataclass(frozen=True)
class Kindred:
    """How to draw an effect."""

    range: tuple[float, float]
    """Amplitudes; the unit is said where the law is."""
    kinds: tuple[Kind, ...] = EVERY
    excited_by: tuple[str, ...] = AIRY
    options: Callable[[Shape, Rng], Options] = lambda shape, rng: {}
    fields: tuple[str, ...] = ("everywhere",)


def _direction(rng: Rng, flat: float = 1.0) -> tuple[float, ...]:
    way = rng.normal(size=3) * [1, 1, flat]
    return tuple(float(v) for v in way / np.linalg.norm(way))


LOCAL = ("everywhere", "half")

CATALOGUE: Mapping[str, Kindred] = {
    "strain_stiffening": Kindred(
        (0.05, 400.0),
        excited_by=PULLS,
        fields=LOCAL,
        options=lambda s, r: (
            {"form": 0.0, "exponent": float(r.uniform(1.2, 3.0)), "scale": 0.1}
            if r.random() < 0.5
            else {"form": 1.0, "rate": float(r.uniform(10, 60))}
        ),
    ),
    "tension_only": Kindred((0.1, 0.97), kinds=("sheet", "solid"), excited_by=(*PULLS, "drag"), fields=LOCAL),
    "viscoelasticity": Kindred(
        (0.1, 8.0),
        excited_by=(*PULLS, "drop"),
        fields=LOCAL,
        options=lambda s, r: {"fast": float(r.uniform(0.04, 0.12)), "slow": float(r.uniform(0.2, 0.9))},
    ),
    "plasticity": Kindred(
        (0.1, 0.97),
        excited_by=PULLS,
        fields=LOCAL,
        options=lambda s, r: {"yield": float(r.uniform(0.01, 0.04)), "sharpness": float(r.uniform(1.5, 4.0))},
    ),
    "damage": Kindred(
        (0.1, 0.95),
        excited_by=("stretch", "staircase", "shake", "lift", "press", "twist"),
        fields=LOCAL,
        options=lambda s, r: {"scale": float(r.uniform(0.015, 0.05))},
    ),
    "anisotropy": Kindred(
        (0.1, 20.0),
        kinds=("sheet", "solid"),
        excited_by=PULLS,
        fields=LOCAL,
        options=lambda s, r: {"angle": float(r.uniform(0, np.pi))},
    ),
    "bending_stiffness": Kindred(
        (1e-6, 3.0), kinds=("rope", "sheet"), excited_by=(*AIRY, "drag"), fields=LOCAL
    ),
    "volume_preservation": Kindred((0.3, 20.0), kinds=("solid",), excited_by=(*PULLS, "drop"), fields=LOCAL),
    "quadratic_air_drag": Kindred(
        (0.02, 40.0), options=lambda s, r: {"exponent": float(r.uniform(1.8, 2.2))}
    ),
    "wind": Kindred(
        (0.01, 6.0),
        excited_by=(*AIRY, "drag"),
        options=lambda s, r: {
            "direction": _direction(r, 0.1),
            "speed": float(r.uniform(2.5, 6.0)),
            "gust": float(r.uniform(0, 0.3)),
            "gust_rate": float(r.uniform(0.2, 0.8)),
            "shear": float(r.uniform(0, 0.25)),
        },
    ),
    "gravity_tilt": Kindred(
        (0.02, 5.0), excited_by=(*AIRY, "drag"), options=lambda s, r: {"direction": _direction(r, 0.0)}
    ),
    "mass_heterogeneity": Kindred((0.1, 12.0), excited_by=(*AIRY, "drag"), fields=("ball",)),
    "grip_slip": Kindred(
        (0.02, 30.0),
        excited_by=("lift", "hang", "shake", "stretch", "staircase", "drag"),
        options=lambda s, r: {"threshold": float(r.uniform(0.2, 0.6))},
    ),
    "actuation_delay": Kindred(
        (0.004, 0.3),
        excited_by=("lift", "shake", "stretch", "staircase", "drag", "hang", "press", "fold", "twist"),
        options=lambda s, r: {"sign": float(r.choice([-1.0, 1.0], p=[0.3, 0.7]))},
    ),
    "adhesion": Kindred(
        (0.5, 400.0),
        excited_by=("lift", "shake", "fold", "stretch"),
        options=lambda s, r: {"range": float(r.uniform(0.004, 0.012))},
    ),
    "static_friction": Kindred(
        (0.1, 3.0),
        excited_by=("drag", "fold", "lift"),
        options=lambda s, r: {"speed": float(r.uniform(0.02, 0.08))},
    ),
    "self_collision": Kindred(
        (0.006, 0.03), kinds=("rope", "sheet"), excited_by=("fold", "lift", "shake"), options=lambda s, r: {}
    ),
}

OUTSIDE: Mapping[str, Kindred] = {
    "magnet": Kindred(
        (0.3, 60.0),
        excited_by=(*AIRY, "drag"),
        options=lambda s, r: {
            "aside": float(r.uniform(-0.3, 0.3)),
            "along": float(r.uniform(-0.3, 0.3)),
            "high": float(r.uniform(0.05, 0.5)),
            "exponent": float(r.uniform(1.5, 3.0)),
        },
    ),
    "shrinkage": Kindred(
        (0.005, 0.25),
        excited_by=(*AIRY, "press", "drag"),
        fields=LOCAL,
        options=lambda s, r: {"sign": float(r.choice([-1.0, 1.0], p=[0.75, 0.25]))},
    ),
    "hand_torque": Kindred(
        (0.05, 1.6),
        kinds=("sheet", "solid"),
        excited_by=("lift", "hang", "stretch", "shake"),
        options=lambda s, r: {"axis": _direction(r), "rate": float(r.uniform(0.2, 0.6))},
    ),
    "moving_base": Kindred(
        (0.1, 4.0), excited_by=(*AIRY, "drag"), options=lambda s, r: {"axis": _direction(r)}
    ),
    "stick_patch": Kindred(
        (5.0, 4000.0), excited_by=("lift", "drag", "fold", "stretch", "shake", "hang"), fields=("ball",)
    ),
    "buoyancy": Kindred(
        (0.05, 1.6),
        excited_by=("lift", "shake", "hang", "fold", "stretch", "drop"),
        options=lambda s, r: {"height": float(r.uniform(0.15, 0.5))},
    ),
}

ALL: Mapping[str, Kindred] = {**CATALOGUE, **OUTSIDE}


def draw(name: str, shape: Shape, amplitude: float, rng: Rng) -> Effect:
    """An effect with its options and its place drawn by lot."""
    kindred = ALL[name]
    kind = kindred.fields[rng.integers(len(kindred.fields))]
    where = Field()
    if kind == "half":
        way = np.zeros(3)
        axes = [0] if shape.kind == "rope" else [0, 1]
        way[rng.choice(axes)] = rng.choice([-1.0, 1.0])
        middle = shape.surface.mean(axis=0)
        where = Field("half", tuple(middle), tuple(way), 0.04 * shape.length)
    elif kind == "ball":
        where = Field(
            "ball",
            tuple(shape.surface[rng.integers(len(shape.surface))]),
            width=rng.uniform(0.1, 0.18) * shape.length,
        )
    return Effect(name, amplitude, kindred.options(shape, rng), where)
