"""The laws of small groups of points, traced."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from model.simulator.forces.base import Law, Scalar, arguments
from model.simulator.forces.stencil import StencilForce
from model.simulator.kernel.differentiate import pullback
from model.simulator.kernel.expression import Expression, Untraceable
from model.simulator.kernel.graph import Graph
from model.simulator.kernel.groups import Input, key

AXES = 3


@dataclass(frozen=True)
class Corners:
    """The forces on the points of one stencil, as expressions of the symbols below."""

    size: int
    inputs: tuple[Input, ...]
    symbols: tuple[str, ...]
    """`x.c.k`: place (k < 3) and velocity of corner c; `pulled.c.k`: the adjoint of its force. Besides these
    `dt`, `term.name` of inputs and memory, and `.bar` of memory after the substep."""
    forces: tuple[Expression, ...]
    """Corner by corner, three components each."""
    memory: tuple[tuple[str, str], ...]
    """Term and variable."""
    updates: tuple[Expression, ...]
    """The memory after the substep."""
    places: tuple[Expression, ...]
    """The adjoint of place and velocity, corner by corner, six components each."""
    constants: tuple[Expression, ...]
    """That of each input, in order."""
    memories: tuple[Expression, ...]
    """That of each variable of memory before the substep, in order."""


@lru_cache(maxsize=256)
def trace_corners(kind: type[StencilForce], each: tuple[tuple[str, bool], ...]) -> Corners:
    """Run a law on symbols.

    Args:
        kind: The force.
        each: For each of its constants: whether it has one value per stencil.

    Raises:
        Untraceable: the law does what has no symbol; names the term.
    """
    graph = Graph()
    at = [[graph.symbol(f"x.{c}.{k}") for k in range(2 * AXES)] for c in range(kind.size)]
    pulled = [graph.symbol(f"pulled.{c}.{k}") for c in range(kind.size) for k in range(AXES)]
    constants = {name: graph.symbol(key(kind.name, name)) for name, _ in each}
    memory = {name: graph.symbol(key(kind.name, name)) for name in kind.memory}
    bars = [graph.symbol(f"{key(kind.name, name)}.bar") for name in kind.memory]
    known: dict[str, object] = {
        "positions": tuple(tuple(corner[:AXES]) for corner in at),
        "velocities": tuple(tuple(corner[AXES:]) for corner in at),
        **constants,
        **memory,
    }
    try:
        forces = _forces(graph, kind, known, [x for corner in at for x in corner[:AXES]])
        updates = _updates(graph, kind, {**known, "dt": graph.symbol("dt")})
    except Untraceable as error:
        raise Untraceable(f"the law of {kind.name!r} cannot be traced: {error}") from error
    wanted = [*(x for corner in at for x in corner), *constants.values(), *memory.values()]
    back = pullback(graph, [*forces, *updates], [*pulled, *bars], wanted)
    symbols = [f"x.{c}.{k}" for c in range(kind.size) for k in range(2 * AXES)]
    symbols += [f"pulled.{c}.{k}" for c in range(kind.size) for k in range(AXES)]
    split, last = len(wanted) - len(constants) - len(memory), len(wanted) - len(memory)
    return Corners(
        kind.size,
        tuple(Input(kind.name, name, one) for name, one in each),
        tuple(symbols),
        tuple(forces),
        tuple((kind.name, name) for name in kind.memory),
        tuple(updates),
        tuple(back[:split]),
        tuple(back[split:last]),
        tuple(back[last:]),
    )


def _forces(
    graph: Graph, kind: type[StencilForce], known: Mapping[str, object], places: list[Expression]
) -> list[Expression]:
    law = kind.law or kind.potential
    if law is None:
        raise Untraceable("it has neither a law nor a potential")
    result = _asked(law, known)
    if kind.law is not None:
        return [graph.number(component) for force in result for component in force]
    slope = pullback(graph, [graph.number(result)], [graph.constant(1.0)], places)
    return [graph.neg(component) for component in slope]


def _updates(graph: Graph, kind: type[StencilForce], known: Mapping[str, object]) -> list[Expression]:
    if not kind.memory:
        return []
    if kind.after is None:
        raise Untraceable("it remembers, and no law says what")
    return [graph.number(value) for value in _asked(kind.after, known)]


def _asked(law: Law, known: Mapping[str, object]) -> Scalar:
    """What a law says of symbols."""
    given = {}
    for name in arguments(law):
        if name not in known:
            raise Untraceable(f"it asks for {name!r}, which is nothing of a stencil")
        given[name] = known[name]
    return law(**given)
