"""A symbol that answers to arithmetic and torch functions by recording them."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from model.simulator.kernel.graph import Graph

Scalar: TypeAlias = object
"""An expression or a number; anything else is refused by name."""


class Untraceable(Exception):
    """A law does something that has no symbol; says what."""


class Expression:
    """One operation on expressions: a node of a `Graph`, in which equal nodes are the same object."""

    __slots__ = ("arguments", "graph", "number", "operation", "value")

    def __init__(
        self,
        graph: "Graph",
        operation: str,
        arguments: tuple["Expression", ...],
        value: float | str | None,
        number: int,
    ) -> None:
        """Made by a `Graph` alone; `number` grows along every path from the symbols upwards."""
        self.graph, self.operation, self.arguments = graph, operation, arguments
        self.value, self.number = value, number

    def __add__(self, other: Scalar) -> "Expression":
        """Sum."""
        return self.graph.add(self, other)

    __radd__ = __add__

    def __neg__(self) -> "Expression":
        """Negative."""
        return self.graph.neg(self)

    def __sub__(self, other: Scalar) -> "Expression":
        """Difference."""
        return self.graph.sub(self, other)

    def __rsub__(self, other: Scalar) -> "Expression":
        """Difference."""
        return self.graph.sub(other, self)

    def __mul__(self, other: Scalar) -> "Expression":
        """Product."""
        return self.graph.mul(self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Scalar) -> "Expression":
        """Quotient."""
        return self.graph.div(self, other)

    def __rtruediv__(self, other: Scalar) -> "Expression":
        """Quotient."""
        return self.graph.div(other, self)

    def __pow__(self, power: Scalar) -> "Expression":
        """Power."""
        return self.graph.pow(self, power)

    def __rpow__(self, base: Scalar) -> "Expression":
        """Power."""
        return self.graph.pow(base, self)

    def __abs__(self) -> "Expression":
        """Magnitude."""
        return self.graph.abs(self)

    def __lt__(self, other: Scalar) -> "Expression":
        """Less."""
        return self.graph.lt(self, other)

    def __gt__(self, other: Scalar) -> "Expression":
        """Greater."""
        return self.graph.gt(self, other)

    def __le__(self, other: Scalar) -> "Expression":
        """Less or equal."""
        return self.graph.le(self, other)

    def __ge__(self, other: Scalar) -> "Expression":
        """Greater or equal."""
        return self.graph.ge(self, other)

    def __and__(self, other: "Expression") -> "Expression":
        """Both."""
        return self.graph.logical_and(self, other)

    def __or__(self, other: "Expression") -> "Expression":
        """Either."""
        return self.graph.logical_or(self, other)

    def __invert__(self) -> "Expression":
        """The opposite."""
        return self.graph.logical_not(self)

    def __bool__(self) -> bool:
        """Nobody knows yet."""
        raise Untraceable("it branches on a value: use torch.where")

    def __getattr__(self, name: str) -> Callable[..., "Expression"]:
        """Methods that tensors have, `x.exp()`."""
        if name not in FUNCTIONS:
            raise Untraceable(f"a symbol has no {name!r}")
        return lambda *args, **kwargs: _called(name, (self, *args), kwargs)

    @classmethod
    def __torch_function__(
        cls,
        function: Callable[..., Any],
        types: Sequence[type],
        args: Sequence[Any] = (),
        kwargs: Mapping[str, Any] | None = None,
    ) -> "Expression":
        """Record `torch.exp(x)` and its like."""
        return _called(getattr(function, "__name__", str(function)), args, kwargs or {})


FUNCTIONS = {
    "abs": "abs",
    "add": "add",
    "clamp": "clamp",
    "clamp_max": "clamp_max",
    "clamp_min": "clamp_min",
    "cos": "cos",
    "detach": "detach",
    "div": "div",
    "exp": "exp",
    "ge": "ge",
    "gt": "gt",
    "le": "le",
    "log": "log",
    "logical_and": "logical_and",
    "logical_not": "logical_not",
    "logical_or": "logical_or",
    "lt": "lt",
    "maximum": "maximum",
    "minimum": "minimum",
    "mul": "mul",
    "multiply": "mul",
    "neg": "neg",
    "ones_like": "ones_like",
    "pow": "pow",
    "reciprocal": "reciprocal",
    "relu": "relu",
    "sin": "sin",
    "sqrt": "sqrt",
    "square": "square",
    "sub": "sub",
    "subtract": "sub",
    "tanh": "tanh",
    "true_divide": "div",
    "where": "where",
    "zeros_like": "zeros_like",
}
"""Torch functions a law may use, and the method of `Graph` that each is."""


def _called(name: str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Expression:
    if name not in FUNCTIONS:
        raise Untraceable(f"torch.{name} has no symbol")
    graph = next(a.graph for a in [*args, *kwargs.values()] if isinstance(a, Expression))
    try:
        made: Expression = getattr(graph, FUNCTIONS[name])(*args, **kwargs)
    except TypeError as error:
        raise Untraceable(f"torch.{name} is called with arguments that have no symbol ({error})") from error
    return made
