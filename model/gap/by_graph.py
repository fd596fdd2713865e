"""Numbers of an effect that go by the graph on which it acts, as those of another graph."""

import numpy as np
from pydantic import JsonValue

from model.gap.carried import CATALOGUE
from model.gap.graph import Graph
from model.schema import EffectRecord
from model.simulator.structure import rows, spans

NUMBERS = ("value", "ci95")
"""Of a parameter, what has its unit."""


def by_graph(record: EffectRecord, before: Graph, after: Graph) -> EffectRecord:
    """An effect on one graph, its law's numbers that go by it as those of another.

    A distance in spacings is as long as before, and rows of points resist bending as much in sum: with B κ²/s
    of each, a bend that all share costs B times the length of all rows.

    Args:
        record: Of the effect; each of its parameters is a number, or an object with `value`.
        before: On which it has these numbers.
        after: On which it is to act.
    """
    in_rows = _in_rows(before) / max(_in_rows(after), 1e-12)
    factors = {
        ("self_collision", "distance"): before.spacing / after.spacing,
        ("bending_stiffness", "bending_stiffness"): in_rows,
        ("plasticity", "bending_stiffness"): in_rows,
    }
    parameters = dict(record.parameters)
    for (effect, name), factor in factors.items():
        if effect != record.name or name not in parameters:
            continue
        told = parameters[name]
        if isinstance(told, dict):
            scaled = {key: _scaled(told[key], factor, effect, name) for key in NUMBERS if key in told}
            parameters[name] = {**told, **scaled}
        else:
            parameters[name] = _scaled(told, factor, effect, name)
    return record.model_copy(update={"parameters": parameters})


def _scaled(told: JsonValue, factor: float, effect: str, name: str) -> JsonValue:
    """Within the bounds; what is absent stays so."""
    kind, value = CATALOGUE[effect], np.asarray(told, np.float64)
    low, high = kind.quantities[name].bounds
    there = value != kind.absent.get(name)
    scaled: JsonValue = np.where(there, np.clip(factor * value, low, high), value).tolist()
    return scaled


def _in_rows(graph: Graph) -> float:
    """Length of all rows of points together [m]."""
    return float(spans(graph.points, rows(graph.points, graph.springs)).sum())
