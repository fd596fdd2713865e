"""A scalar law, run once on symbols: what is left is the graph of its operations.

A law is ordinary Python over numbers or tensors (`stiffness * (length - rest_length)`, `torch.exp(x)`).
Given symbols instead, it leaves behind a graph in which equal subexpressions are one node.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from model.simulator.kernel.arithmetic import CONDITIONS, compute
from model.simulator.kernel.expression import Expression, Scalar, Untraceable


class Graph:
    """Where expressions live; simplifies as it builds."""

    def __init__(self) -> None:
        """An empty graph."""
        self._nodes: dict[tuple[Any, ...], Expression] = {}

    def symbol(self, name: str) -> Expression:
        """What is not known until the law runs."""
        return self._node("symbol", (), name)

    def constant(self, value: Scalar) -> Expression:
        """A number; expressions pass."""
        if isinstance(value, Expression):
            return value
        if not isinstance(value, int | float):
            raise Untraceable(f"it computes with a {type(value).__name__}: use numbers")
        return self._node("constant", (), float(value))

    def add(self, a: Scalar, b: Scalar) -> Expression:
        """Sum."""
        a, b = self.constant(a), self.constant(b)
        if _is(a, 0.0):
            return b
        if _is(b, 0.0):
            return a
        if b.operation == "neg":
            return self.sub(a, b.arguments[0])
        if a.operation == "neg":
            return self.sub(b, a.arguments[0])
        return self._made("add", *sorted((a, b), key=lambda e: e.number))

    def sub(self, a: Scalar, b: Scalar) -> Expression:
        """Difference."""
        a, b = self.constant(a), self.constant(b)
        if _is(b, 0.0):
            return a
        if _is(a, 0.0):
            return self.neg(b)
        if a is b:
            return self.constant(0.0)
        return self.add(a, b.arguments[0]) if b.operation == "neg" else self._made("sub", a, b)

    def neg(self, a: Scalar) -> Expression:
        """Negative."""
        a = self.constant(a)
        return a.arguments[0] if a.operation == "neg" else self._made("neg", a)

    def mul(self, a: Scalar, b: Scalar) -> Expression:
        """Product."""
        a, b = self.constant(a), self.constant(b)
        if _is(a, 0.0) or _is(b, 0.0):
            return self.constant(0.0)
        for x, y in ((a, b), (b, a)):
            if _is(x, 1.0):
                return y
            if _is(x, -1.0):
                return self.neg(y)
            if x.operation == "neg":
                return self.neg(self.mul(x.arguments[0], y))
        return self._made("mul", *sorted((a, b), key=lambda e: e.number))

    def div(self, a: Scalar, b: Scalar) -> Expression:
        """Quotient."""
        a, b = self.constant(a), self.constant(b)
        if _is(a, 0.0) or _is(b, 1.0):
            return a
        if b.operation == "constant" and b.value:
            return self.mul(a, 1.0 / _number(b))
        return self._made("div", a, b)

    def reciprocal(self, a: Scalar) -> Expression:
        """1/a."""
        return self.div(1.0, a)

    def square(self, a: Scalar) -> Expression:
        """a²."""
        return self.mul(a, a)

    def pow(self, base: Scalar, power: Scalar) -> Expression:
        """Products where the power is a small whole number."""
        base, power = self.constant(base), self.constant(power)
        known = _number(power) if power.operation == "constant" else math.nan
        if known == 0.5:
            return self.sqrt(base)
        if not known.is_integer() or abs(known) > 64:
            return self._made("pow", base, power)
        if known < 0:
            return self.div(1.0, self.pow(base, -known))
        result, square, left = self.constant(1.0), base, int(known)
        while left:
            if left % 2:
                result = self.mul(result, square)
            square, left = self.mul(square, square), left // 2
        return result

    def minimum(self, a: Scalar, b: Scalar) -> Expression:
        """The smaller."""
        return self._made("minimum", self.constant(a), self.constant(b))

    def maximum(self, a: Scalar, b: Scalar) -> Expression:
        """The larger."""
        return self._made("maximum", self.constant(a), self.constant(b))

    def clamp(self, a: Scalar, min: Scalar | None = None, max: Scalar | None = None) -> Expression:
        """Within bounds."""
        a = self.constant(a)
        a = a if min is None else self.clamp_min(a, min)
        return a if max is None else self.clamp_max(a, max)

    def clamp_min(self, a: Scalar, min: Scalar) -> Expression:
        """Not below a bound; at it, the derivative passes."""
        return self.where(self.lt(a, min), min, a)

    def clamp_max(self, a: Scalar, max: Scalar) -> Expression:
        """Not above a bound; at it, the derivative passes."""
        return self.where(self.lt(max, a), max, a)

    def relu(self, a: Scalar) -> Expression:
        """The positive part."""
        return self.where(self.lt(0.0, a), a, 0.0)

    def zeros_like(self, a: Scalar) -> Expression:
        """0."""
        return self.constant(0.0)

    def ones_like(self, a: Scalar) -> Expression:
        """1."""
        return self.constant(1.0)

    def where(self, condition: Scalar, a: Scalar, b: Scalar) -> Expression:
        """`a` where the condition holds, else `b`."""
        condition, a, b = self.constant(condition), self.constant(a), self.constant(b)
        if a is b:
            return a
        if condition.operation == "constant":
            return a if condition.value else b
        return self._made("where", condition, a, b)

    def sqrt(self, a: Scalar) -> Expression:
        """Square root."""
        return self._made("sqrt", self.constant(a))

    def exp(self, a: Scalar) -> Expression:
        """Exponential."""
        return self._made("exp", self.constant(a))

    def log(self, a: Scalar) -> Expression:
        """Natural logarithm."""
        return self._made("log", self.constant(a))

    def sin(self, a: Scalar) -> Expression:
        """Sine."""
        return self._made("sin", self.constant(a))

    def cos(self, a: Scalar) -> Expression:
        """Cosine."""
        return self._made("cos", self.constant(a))

    def tanh(self, a: Scalar) -> Expression:
        """Hyperbolic tangent."""
        return self._made("tanh", self.constant(a))

    def abs(self, a: Scalar) -> Expression:
        """Magnitude."""
        return self._made("abs", self.constant(a))

    def detach(self, a: Scalar) -> Expression:
        """The same value, whose derivative is not wanted."""
        return self._made("detach", self.constant(a))

    def lt(self, a: Scalar, b: Scalar) -> Expression:
        """Less."""
        return self._made("lt", self.constant(a), self.constant(b))

    def gt(self, a: Scalar, b: Scalar) -> Expression:
        """Greater."""
        return self.lt(b, a)

    def le(self, a: Scalar, b: Scalar) -> Expression:
        """Less or equal."""
        return self._made("le", self.constant(a), self.constant(b))

    def ge(self, a: Scalar, b: Scalar) -> Expression:
        """Greater or equal."""
        return self.le(b, a)

    def logical_and(self, a: Scalar, b: Scalar) -> Expression:
        """Both."""
        return self._made("and", self.constant(a), self.constant(b))

    def logical_or(self, a: Scalar, b: Scalar) -> Expression:
        """Either."""
        return self._made("or", self.constant(a), self.constant(b))

    def logical_not(self, a: Scalar) -> Expression:
        """The opposite."""
        return self._made("not", self.constant(a))

    def _made(self, operation: str, *arguments: Expression) -> Expression:
        """The node, or its value where all arguments are numbers."""
        if operation not in ("and", "or", "not"):
            first = arguments[:1] if operation == "where" else ()
            arguments = (*first, *(self.number(a) for a in arguments[len(first) :]))
        if all(a.operation == "constant" for a in arguments):
            folded = compute(operation, [_number(a) for a in arguments])
            if math.isfinite(folded):
                return self.constant(folded)
        return self._node(operation, arguments, None)

    def number(self, a: Scalar) -> Expression:
        """Conditions as 1 and 0, as torch has them in sums and products; all else as it is."""
        a = self.constant(a)
        return self.where(a, 1.0, 0.0) if a.operation in CONDITIONS else a

    def _node(
        self, operation: str, arguments: tuple[Expression, ...], value: float | str | None
    ) -> Expression:
        key = (operation, tuple(a.number for a in arguments), value)
        if key not in self._nodes:
            self._nodes[key] = Expression(self, operation, arguments, value, len(self._nodes))
        return self._nodes[key]


def ordered(outputs: Sequence[Expression]) -> list[Expression]:
    """Everything the outputs are made of, arguments before what uses them."""
    seen: dict[int, Expression] = {}
    waiting = list(outputs)
    while waiting:
        node = waiting.pop()
        if node.number not in seen:
            seen[node.number] = node
            waiting.extend(node.arguments)
    return [seen[number] for number in sorted(seen)]


def evaluate(outputs: Sequence[Expression], symbols: Mapping[str, float]) -> list[float]:
    """Numbers for expressions, given numbers for their symbols."""
    known: dict[int, float] = {}
    for node in ordered(outputs):
        if node.operation == "symbol":
            known[node.number] = symbols[str(node.value)]
        elif node.operation == "constant":
            known[node.number] = _number(node)
        else:
            known[node.number] = compute(node.operation, [known[a.number] for a in node.arguments])
    return [known[output.number] for output in outputs]


def _is(node: Expression, value: float) -> bool:
    return node.operation == "constant" and node.value == value


def _number(node: Expression) -> float:
    assert isinstance(node.value, float)
    return node.value
