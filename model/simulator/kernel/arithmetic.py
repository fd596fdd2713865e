"""What each operation of a traced law does with numbers."""

import math
from collections.abc import Callable, Mapping, Sequence

CONDITIONS = ("and", "le", "lt", "not", "or")
"""Operations whose value is true or false."""
PYTHON: Mapping[str, Callable[..., float]] = {
    "abs": abs,
    "add": lambda a, b: a + b,
    "and": lambda a, b: float(bool(a) and bool(b)),
    "cos": math.cos,
    "detach": lambda a: a,
    "div": lambda a, b: a / b,
    "exp": math.exp,
    "le": lambda a, b: float(a <= b),
    "log": math.log,
    "lt": lambda a, b: float(a < b),
    "maximum": max,
    "minimum": min,
    "mul": lambda a, b: a * b,
    "neg": lambda a: -a,
    "not": lambda a: float(not a),
    "or": lambda a, b: float(bool(a) or bool(b)),
    "pow": lambda a, b: a**b,
    "sin": math.sin,
    "sqrt": math.sqrt,
    "sub": lambda a, b: a - b,
    "tanh": math.tanh,
    "where": lambda c, a, b: a if c else b,
}
"""What each operation does with numbers."""


def compute(operation: str, arguments: Sequence[float]) -> float:
    """NaN where Python would raise."""
    try:
        return PYTHON[operation](*arguments)
    except (ArithmeticError, ValueError):
        return math.nan
