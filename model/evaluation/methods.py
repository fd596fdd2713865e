"""Methods by what is written on the command line."""

from model.errors import InputError
from model.evaluation.baselines import ALL_METHODS
from model.evaluation.baselines.base import Method


def chosen(written: str) -> dict[str, Method]:
    """Methods by name, in the order in which they are written.

    Args:
        written: Comma-separated names of methods, or `all`.

    Raises:
        InputError: no such method, one is named twice, or nothing is written.
    """
    words = [word.strip() for word in written.split(",") if word.strip()]
    if not words:
        raise InputError(f"--methods {written!r}: expected names, like matphys,prior-mean")
    every = [method.name for method in ALL_METHODS]
    pairs = [_method(name) for word in words for name in (every if word == "all" else [word])]
    if len(dict(pairs)) < len(pairs):
        raise InputError(f"--methods {written}: a method is named twice: give each its own name")
    return dict(pairs)


def _method(word: str) -> tuple[str, Method]:
    name = word.replace("_", "-")
    known = {method.name: method for method in ALL_METHODS}
    if name not in known:
        raise InputError(f"--methods: no method {name!r}: choose from {', '.join(known)}")
    return name, known[name]()
