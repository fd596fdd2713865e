"""Reverse differentiation of traced laws: the derivatives are expressions of the same graph."""

from collections.abc import Callable, Mapping, Sequence

from model.simulator.kernel.expression import Expression
from model.simulator.kernel.graph import Graph, ordered


def pullback(
    graph: Graph,
    outputs: Sequence[Expression],
    adjoints: Sequence[Expression],
    inputs: Sequence[Expression],
) -> list[Expression]:
    r"""For each input $x$ the sum over outputs of $\bar y\,\partial y/\partial x$.

    Args:
        graph: Where all of it lives.
        outputs: The y.
        adjoints: The ȳ, one expression per output.
        inputs: The x; symbols as a rule.

    Reference:
        Griewank and Walther (2008), Evaluating derivatives, SIAM, section 3.2 (the reverse mode).
    """
    known: dict[int, Expression] = {}

    def flow(node: Expression, adjoint: Expression) -> None:
        known[node.number] = graph.add(known[node.number], adjoint) if node.number in known else adjoint

    for output, adjoint in zip(outputs, adjoints, strict=True):
        flow(output, adjoint)
    for node in reversed(ordered(outputs)):
        if node.number in known and node.operation in _RULES:
            shares = _RULES[node.operation](graph, node, known[node.number])
            for argument, share in zip(node.arguments, shares, strict=True):
                if share is not None and argument.operation != "constant":
                    flow(argument, share)
    return [known.get(x.number, graph.constant(0.0)) for x in inputs]


Shares = tuple[Expression | None, ...]


def _divided(g: Graph, node: Expression, adjoint: Expression) -> Shares:
    share = g.div(adjoint, node.arguments[1])
    return share, g.neg(g.mul(share, node))


def _power(g: Graph, node: Expression, adjoint: Expression) -> Shares:
    base, power = node.arguments
    by_base = g.mul(adjoint, g.mul(power, g.pow(base, g.sub(power, 1.0))))
    if power.operation == "constant":
        return by_base, None
    return by_base, g.mul(adjoint, g.mul(node, g.log(base)))


def _smaller(g: Graph, node: Expression, adjoint: Expression) -> Shares:
    a, b = node.arguments
    return _first(g, a, b, adjoint), _first(g, b, a, adjoint)


def _larger(g: Graph, node: Expression, adjoint: Expression) -> Shares:
    a, b = node.arguments
    return _first(g, b, a, adjoint), _first(g, a, b, adjoint)


def _first(g: Graph, a: Expression, b: Expression, adjoint: Expression) -> Expression:
    """The adjoint where a < b; half of it where they are equal, as torch has it."""
    return g.where(g.lt(a, b), adjoint, g.where(g.lt(b, a), 0.0, g.mul(0.5, adjoint)))


def _chosen(g: Graph, node: Expression, adjoint: Expression) -> Shares:
    condition = node.arguments[0]
    return None, g.where(condition, adjoint, 0.0), g.where(condition, 0.0, adjoint)


def _magnitude(g: Graph, node: Expression, adjoint: Expression) -> Shares:
    a = node.arguments[0]
    return (g.where(g.lt(0.0, a), adjoint, g.where(g.lt(a, 0.0), g.neg(adjoint), 0.0)),)


_RULES: Mapping[str, Callable[[Graph, Expression, Expression], Shares]] = {
    "abs": _magnitude,
    "add": lambda g, n, y: (y, y),
    "cos": lambda g, n, y: (g.neg(g.mul(y, g.sin(n.arguments[0]))),),
    "div": _divided,
    "exp": lambda g, n, y: (g.mul(y, n),),
    "log": lambda g, n, y: (g.div(y, n.arguments[0]),),
    "maximum": _larger,
    "minimum": _smaller,
    "mul": lambda g, n, y: (g.mul(y, n.arguments[1]), g.mul(y, n.arguments[0])),
    "neg": lambda g, n, y: (g.neg(y),),
    "pow": _power,
    "sin": lambda g, n, y: (g.mul(y, g.cos(n.arguments[0])),),
    "sqrt": lambda g, n, y: (g.div(g.mul(0.5, y), n),),
    "sub": lambda g, n, y: (y, g.neg(y)),
    "tanh": lambda g, n, y: (g.mul(y, g.sub(1.0, g.mul(n, n))),),
    "where": _chosen,
}
"""What each operation passes on to its arguments; those not named here pass nothing."""
