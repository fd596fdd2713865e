"""Shapes and types of what every function of the model is given and returns, in its first calls of each test.

To check all calls takes ten times as long where a rollout calls the same function in each of its time steps,
which says the same again and again.
"""

import sys
from collections import Counter
from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

from beartype import beartype

FIRST = 20
"""Calls of each function, in each test, that are checked."""
SINGLE = "check_single_arg"
"""What jaxtyping calls the functions by which it finds the argument that is wrong."""
_calls: Counter[tuple[str, str]] = Counter()
_silent: list[FunctionType] = []


def first_calls(function: FunctionType) -> Callable[..., Any]:
    """What jaxtyping asks of a type checker: a function that raises where it is given something else.

    Args:
        function: Of jaxtyping's making, with the annotations and the name of one of the model.
    """
    name = function.__module__, function.__qualname__

    @cache
    def check() -> Callable[..., Any]:
        return beartype(function)

    def checked(*args: Any, **kwargs: Any) -> Any:
        _calls[name] += 1
        # asked twice for each call: what it is given, and that with what it returns
        if _calls[name] > 2 * FIRST:
            _silence(*name)
            return None
        return check()(*args, **kwargs)

    return check() if function.__name__ == SINGLE else checked


def begin_test() -> None:
    """Check first calls again."""
    _calls.clear()
    while _silent:
        del _silent.pop().__no_type_check__


def _silence(module: str, qualname: str) -> None:
    """Have jaxtyping call a function as it is; one within another is not found, and asks each time."""
    found: Any = sys.modules.get(module)
    for part in qualname.split("."):
        found = vars(found).get(part) if hasattr(found, "__dict__") else None
    for inner in ("__func__", "fget", "func"):
        found = getattr(found, inner, found)
    if isinstance(found, FunctionType) and not hasattr(found, "__no_type_check__"):
        found.__no_type_check__ = True
        _silent.append(found)
