"""The first stage of fits in PhysTwin's manner: springs and globals by a search without gradients."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Int

from model.evaluation.baselines.evolution import Axis, evolve
from model.evaluation.baselines.mechanics import (
    LEAST,
    MOST_RESTITUTION,
    Mechanics,
    grip_stiffness,
    moved,
    prior_globals,
    prior_modulus,
    unit_stiffness,
)
from model.evaluation.baselines.seen import Seen
from model.evaluation.baselines.wiring import Wires, Wiring
from model.predictor.prior_means import GRIP
from model.scenes.case import Case
from model.simulator.divergence import SimulationDiverged
from model.topology import GRIP_SPRINGS, NEIGHBOURS, REACH
from model.types import Array

DECADES = math.log(50.0)
"""How far the modulus may be from the prior's, in ln, either way."""
FACTOR = math.log(20.0)
"""The same of dashpot and drag."""
FIRMNESS = (math.log(0.3), math.log(10.0))
"""Controller springs over the springs of the points that they hold, in ln."""
MOST_FRICTION = 2.0
GRIP_REACH = (1.0, 4.0)
"""How long controller springs may be, in spacings: between these; PhysTwin's 0.01 … 0.08 m of 0.02."""


@dataclass(frozen=True)
class Coarse:
    """What the first stage came to."""

    mechanics: Mechanics
    wiring: Wiring
    loss: float
    """[mm²]."""


def search(
    case: Case,
    seen: Seen,
    region: Int[Array, " P"],
    *,
    generations: int,
    population: int | None,
    seed: int,
) -> Coarse:
    """Modulus, globals, grips, and per region how many springs and how long, by CMA-ES.

    All springs have one modulus. The search begins at the prior's mean and at the springs that
    `build_topology` would make of it.

    Args:
        case: What is fitted.
        seen: Its frames that may be learned from.
        region: Of each mass point; zeros: one rule for all.
        generations: Of CMA-ES.
        population: Of CMA-ES; None: as it sees fit.
        seed: Of its random numbers.
    """
    wires, count = Wires(case.topology, region), int(region.max()) + 1

    def built(numbers: Mapping[str, float]) -> tuple[Mechanics, Wiring]:
        return _build(case, wires, count, numbers)

    def loss(numbers: Mapping[str, float]) -> float:
        mechanics = built(numbers)[0]
        with torch.no_grad():
            try:
                return float(seen.loss(_roll(case, mechanics, len(seen))))
            except SimulationDiverged:
                return math.inf

    best, least = evolve(_axes(case, count), loss, generations=generations, population=population, seed=seed)
    mechanics, wiring = built(best)
    return Coarse(mechanics, wiring, least)


def _roll(case: Case, mechanics: Mechanics, frames: int) -> torch.Tensor:
    made = mechanics
    return moved(case, made.topology, made.stiffness, made.grip, made.globals, frames)


def _build(case: Case, wires: Wires, count: int, numbers: Mapping[str, float]) -> tuple[Mechanics, Wiring]:
    """The twin that the searched numbers mean, no stiffer than `SUBSTEPS` allow."""
    wiring = Wiring(
        neighbours=np.exp([numbers[f"neighbours {each}"] for each in range(count)]),
        reach=np.array([numbers[f"reach {each}"] for each in range(count)]),
        grips=round(numbers["grips"]),
        grip_reach=numbers["grip reach"],
    )
    topology = wires.rewire(wiring)
    stiffness = np.exp(numbers["modulus"]) * unit_stiffness(case, topology)
    grip = np.exp(numbers["firmness"]) * grip_stiffness(topology, stiffness)
    values = {
        "dashpot_damping": math.exp(numbers["dashpot_damping"]),
        "drag_rate": math.exp(numbers["drag_rate"]),
        "friction": numbers["friction"],
        "restitution": numbers["restitution"],
    }
    return Mechanics(topology, stiffness, grip, values).limited(), wiring


def _axes(case: Case, count: int) -> list[Axis]:
    begin = prior_globals(case)
    modulus = math.log(prior_modulus(case))
    usual, reach = NEIGHBOURS[case.shape_class], REACH[case.shape_class]

    def around(name: str) -> Axis:
        middle = math.log(begin[name])
        return Axis(name, middle, middle - FACTOR, middle + FACTOR)

    axes = [
        Axis("modulus", modulus, modulus - DECADES, modulus + DECADES),
        around("dashpot_damping"),
        around("drag_rate"),
        Axis("friction", begin["friction"], LEAST["friction"], MOST_FRICTION),
        Axis("restitution", begin["restitution"], LEAST["restitution"], MOST_RESTITUTION),
        Axis("firmness", math.log(GRIP), *FIRMNESS),
        Axis("grips", float(GRIP_SPRINGS), 2.0, 12.0),
        Axis("grip reach", 2.0, *GRIP_REACH),
    ]
    for each in range(count):
        # a third of the usual number to five thirds of it, and half to twice and a half the reach: as there
        few, many = math.log(usual / 3.0), math.log(usual * 5.0 / 3.0)
        axes += [
            Axis(f"neighbours {each}", math.log(usual), few, many),
            Axis(f"reach {each}", reach, 0.5 * reach, min(2.5 * reach, 4.0)),
        ]
    return axes
