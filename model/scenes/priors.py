"""What a material expert says of a generated case: right, undecided, or sometimes wrong."""

from dataclasses import replace
from typing import Literal, TypeAlias

import numpy as np
from jaxtyping import Float64

from model.errors import InputError
from model.priors.materials import MATERIALS, combine
from model.scenes.case import Case
from model.types import Array, MaterialPrior, ShapeClass

Opinion: TypeAlias = Literal["right", "uniform", "wrong"]
PEAK = (0.75, 0.95)
"""How sure an expert is of the material that it names."""


def with_priors(
    case: Case, opinion: Opinion, rng: np.random.Generator, wrong_probability: float = 0.3
) -> Case:
    """The case with other priors; its topology stays as it is, as does the density that it was made with.

    Args:
        case: A generated case.
        opinion: `right`: peaked on the true material of each part; `uniform`: nothing is known; `wrong`: as
            `right`, but on another material with `wrong_probability`, part by part.
        rng: Draws how sure the expert is, and what it confuses.
        wrong_probability: Of each part's material.

    Raises:
        InputError: the case has no truth.
    """
    if case.truth is None:
        raise InputError(f"case {case.name}: the true materials are not known: its priors stay as they are")
    priors = []
    for known, material in zip(case.priors, case.truth.material, strict=True):
        named = int(material)
        if opinion == "wrong" and rng.random() < wrong_probability:
            named = int((named + rng.integers(1, len(MATERIALS))) % len(MATERIALS))
        weights = uniform() if opinion == "uniform" else peaked(named, rng)
        said = believed(weights, case.shape_class)
        density = known.properties["density"]
        priors.append(replace(said, properties={**said.properties, "density": density}))
    return replace(case, priors=tuple(priors))


def peaked(material: int, rng: np.random.Generator) -> Float64[Array, "10"]:
    """A distribution with most of its weight on one material and the rest spread unevenly."""
    peak = rng.uniform(*PEAK)
    rest = np.insert(rng.dirichlet(np.ones(len(MATERIALS) - 1)), material, 0.0)
    weights: Float64[Array, " m"] = (1.0 - peak) * rest
    weights[material] = peak
    return weights


def uniform() -> Float64[Array, "10"]:
    """Every material is as likely."""
    return np.full(len(MATERIALS), 1.0 / len(MATERIALS))


def believed(distribution: Float64[Array, "10"], shape_class: ShapeClass) -> MaterialPrior:
    """What such a belief says about mechanics."""
    return MaterialPrior(distribution, combine(distribution, shape_class), shape_class)
