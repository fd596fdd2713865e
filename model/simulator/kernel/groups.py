"""The axial laws of a simulator, traced: one sum of tensions per kind of edge."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, TypeAlias

from model.simulator.forces.base import AxialForce, arguments
from model.simulator.kernel.differentiate import pullback
from model.simulator.kernel.expression import Expression, Untraceable
from model.simulator.kernel.graph import Graph

Kind: TypeAlias = Literal["springs", "controllers"]
KINDS: tuple[Kind, ...] = ("springs", "controllers")
Acts: TypeAlias = Kind | int
"""What a constant belongs to: a kind of edge, or the stencils of the law of that number."""
SYSTEM = "system"
"""Stands for a term where a constant is the system's own."""


@dataclass(frozen=True)
class Input:
    """A constant of a law."""

    term: str
    name: str
    each: bool
    """One value per edge; otherwise one of the scene."""


@dataclass(frozen=True)
class Act:
    """A law that acts on a kind of edge."""

    term: str
    law: type[AxialForce]
    each: tuple[tuple[str, bool], ...]
    """For each of its constants: whether it has one value per edge."""


@dataclass(frozen=True)
class Group:
    """What pulls one kind of edge, as expressions of the symbols below."""

    inputs: tuple[Input, ...]
    memory: tuple[tuple[str, str], ...]
    """Term and variable."""
    symbols: Mapping[str, Expression]
    """`length`, `rate`, `dt`, `tension.bar`; `term.name` of inputs and memory, `.bar` of memory."""
    tension: Expression
    updates: tuple[Expression, ...]
    """The memory after the substep."""
    adjoints: Mapping[str, Expression]
    """Of `length`, `rate`, inputs and memory, given those of the tension and of the memory after."""


@lru_cache(maxsize=256)
def trace_group(acts: tuple[Act, ...]) -> Group:
    """Run the laws on symbols.

    Raises:
        Untraceable: a law does what has no symbol; names the term.
    """
    graph = Graph()
    inputs = [Input(SYSTEM, "rest_length", True)]
    inputs += [Input(act.term, name, each) for act in acts for name, each in act.each]
    memory = [(act.term, name) for act in acts for name in act.law.memory]
    names = ["length", "rate", "dt", "tension.bar"]
    names += [key(i.term, i.name) for i in inputs] + [key(*m) for m in memory]
    names += [f"{key(*m)}.bar" for m in memory]
    symbols = {name: graph.symbol(name) for name in names}
    tension, updates = graph.constant(0.0), list[Expression]()
    for act in acts:
        try:
            pull, after = _run(graph, act, symbols)
        except Untraceable as error:
            raise Untraceable(f"the law of {act.term!r} cannot be traced: {error}") from error
        tension = graph.add(tension, pull)
        updates += after
    outputs = [tension, *updates]
    bars = [symbols["tension.bar"], *(symbols[f"{key(*m)}.bar"] for m in memory)]
    wanted = ["length", "rate", *(key(i.term, i.name) for i in inputs), *(key(*m) for m in memory)]
    back = pullback(graph, outputs, bars, [symbols[name] for name in wanted])
    return Group(
        tuple(inputs), tuple(memory), symbols, tension, tuple(updates), dict(zip(wanted, back, strict=True))
    )


def key(term: str, name: str) -> str:
    """How a constant or a variable is called in a group."""
    return f"{term}.{name}"


def _run(
    graph: Graph, act: Act, symbols: Mapping[str, Expression]
) -> tuple[Expression, Sequence[Expression]]:
    own = {name for name, _ in act.each} | set(act.law.memory)
    given = {}
    for name in arguments(act.law.law):
        if name in own:
            given[name] = symbols[key(act.term, name)]
        elif name == "rest_length":
            given[name] = symbols[key(SYSTEM, name)]
        elif name in ("length", "rate", "dt"):
            given[name] = symbols[name]
        else:
            raise Untraceable(f"it asks for {name!r}, which is no number of an edge")
    result = act.law.law(**given)
    if not act.law.memory:
        return graph.number(result), ()
    return graph.number(result[0]), [graph.number(value) for value in result[1:]]
