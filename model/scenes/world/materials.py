"""What the parts of an object are made of: draws from the table of materials."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from model.priors.materials import MATERIALS, typical
from model.scenes.case import ObjectClass
from model.types import ShapeClass

FARTHEST = 2.0
"""No draw is farther from the typical value than so many spreads."""
LIKELY: Mapping[ObjectClass, Mapping[str, float]] = {
    "plush": {
        "fur": 5.0,
        "fabric": 4.0,
        "silk": 2.0,
        "denim": 3.0,
        "leather": 3.0,
        "rubber": 1.0,
        "paper": 1.0,
    },
    "cloth": {
        "fabric": 4.0,
        "denim": 4.0,
        "silk": 4.0,
        "leather": 3.0,
        "fur": 2.0,
        "paper": 2.0,
        "rubber": 2.0,
        "plastic": 1.0,
    },
    "rope": {
        "fabric": 4.0,
        "leather": 3.0,
        "denim": 2.0,
        "silk": 2.0,
        "rubber": 2.0,
        "paper": 1.0,
        "fur": 1.0,
        "metal": 1.0,
    },
    "foam": {
        "fabric": 4.0,
        "rubber": 3.0,
        "paper": 3.0,
        "leather": 2.0,
        "fur": 2.0,
        "plastic": 1.0,
        "wood": 1.0,
        "denim": 1.0,
    },
    "bag": {
        "leather": 4.0,
        "fabric": 3.0,
        "denim": 3.0,
        "paper": 3.0,
        "plastic": 2.0,
        "silk": 1.0,
        "rubber": 1.0,
    },
    "mixed": {name: 1.0 for name in MATERIALS},
}
"""How often a part of each class of object is made of each material."""


@dataclass(frozen=True)
class Substance:
    """What one part is made of."""

    material: int
    """An index into `MATERIALS`."""
    stiffness: float
    """Young's modulus [Pa]."""
    damping: float
    """Ratio [1]."""
    drag_rate: float
    """[1/s]."""
    friction: float
    """[1]."""
    restitution: float
    """[1]."""
    density: float
    """[kg/m³]."""


def draw_substances(
    object_class: ObjectClass, shape_class: ShapeClass, parts: int, rng: np.random.Generator
) -> tuple[Substance, ...]:
    """What the parts of one object are made of; two parts of the same material are the same substance."""
    chosen = draw_materials(object_class, parts, rng)
    if object_class == "mixed" and parts > 1:
        while len(set(chosen)) == 1:
            chosen = draw_materials(object_class, parts, rng)
    made = {material: draw_substance(material, shape_class, rng) for material in dict.fromkeys(chosen)}
    return tuple(made[material] for material in chosen)


def draw_materials(object_class: ObjectClass, parts: int, rng: np.random.Generator) -> tuple[int, ...]:
    """For each part by itself one of the materials of the class, as often as its things are made of them."""
    weights = LIKELY[object_class]
    chance = np.array([weights.get(name, 0.0) for name in MATERIALS], np.float64)
    return tuple(int(one) for one in rng.choice(len(MATERIALS), parts, p=chance / chance.sum()))


def draw_substance(material: int, shape_class: ShapeClass, rng: np.random.Generator) -> Substance:
    """One piece of a material: every property log-normal about what is typical in that shape."""
    rows = typical(MATERIALS[material], shape_class)
    drawn = {
        name: row.mean * float(np.exp(row.spread * np.clip(rng.standard_normal(), -FARTHEST, FARTHEST)))
        for name, row in rows.items()
    }
    drawn["restitution"] = min(drawn["restitution"], 0.9)
    return Substance(material=material, **drawn)
