"""Expressions as C++ statements over vectors `V` of the engine."""

from collections.abc import Mapping, Sequence

from model.simulator.kernel.expression import Expression
from model.simulator.kernel.graph import ordered

FORMS: Mapping[str, str] = {
    "abs": "magnitude({})",
    "add": "{} + {}",
    "and": "{} & {}",
    "cos": "cosine({})",
    "detach": "{}",
    "div": "{} / {}",
    "exp": "exponential({})",
    "le": "{} <= {}",
    "log": "logarithm({})",
    "lt": "{} < {}",
    "maximum": "larger({}, {})",
    "minimum": "smaller({}, {})",
    "mul": "{} * {}",
    "neg": "-{}",
    "not": "~{}",
    "or": "{} | {}",
    "pow": "power({}, {})",
    "sin": "sine({})",
    "sqrt": "root({})",
    "sub": "{} - {}",
    "tanh": "tangent({})",
    "where": "{} ? {} : {}",
}


class Statements:
    """What computes some expressions, each operation once.

    Args:
        outputs: What is wanted; afterwards `name` says how each is called.
        symbols: C++ text of each symbol; read once, into a variable, where an output needs it.
        forms: How operations are written.
    """

    def __init__(
        self, outputs: Sequence[Expression], symbols: Mapping[str, str], forms: Mapping[str, str] = FORMS
    ) -> None:
        """Write the statements."""
        self.lines: list[str] = []
        self._names: dict[int, str] = {}
        for node in ordered(outputs):
            if node.operation == "constant":
                self._names[node.number] = f"splat(R({node.value!r}))"
                continue
            if node.operation == "symbol":
                text = symbols[str(node.value)]
            else:
                text = forms[node.operation].format(*(self._names[a.number] for a in node.arguments))
            name = text if text.isidentifier() else f"t{node.number}"
            if name != text:
                self.lines.append(f"const auto {name} = {text};")
            self._names[node.number] = name

    def name(self, output: Expression) -> str:
        """The C++ text whose value the output is."""
        return self._names[output.number]
