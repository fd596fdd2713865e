"""Methods by what is written on the command line."""

from pathlib import Path

from model.errors import InputError
from model.evaluation.baselines import ALL_METHODS
from model.evaluation.baselines.base import Method
from model.evaluation.matphys import MatPhysMethod

KNOWN: tuple[type[Method], ...] = (MatPhysMethod, *ALL_METHODS)


def chosen(written: str) -> dict[str, Method]:
    """Methods by name, in the order in which they are written.

    Args:
        written: Comma-separated: names of methods, `all`, or `NAME=FILE`, a trained predictor under a name of
            its own, such as an ablation; `NAME=FOLDER`, predictors that each left out other objects.

    Raises:
        InputError: no such method, one is named twice, or nothing is written.
    """
    words = [word.strip() for word in written.split(",") if word.strip()]
    if not words:
        raise InputError(f"--methods {written!r}: expected names, like matphys,prior-mean")
    every = [method.name for method in KNOWN]
    pairs = [_method(name) for word in words for name in (every if word == "all" else [word])]
    if len(dict(pairs)) < len(pairs):
        raise InputError(f"--methods {written}: a method is named twice: give each its own name")
    return dict(pairs)


def _method(word: str) -> tuple[str, Method]:
    name, given, file = word.partition("=")
    if given:
        return name, MatPhysMethod(Path(file))
    name = name.replace("_", "-")
    known = {method.name: method for method in KNOWN}
    if name not in known:
        raise InputError(f"--methods: no method {name!r}: choose from {', '.join(known)}, or give NAME=FILE")
    return name, known[name]()
