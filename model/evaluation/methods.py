"""Methods by what is written on the command line."""

from collections.abc import Callable, Mapping
from pathlib import Path

from model.errors import InputError
from model.evaluation.baselines import ALL_METHODS
from model.evaluation.baselines.base import Method
from model.evaluation.baselines.nearest_anchors import NearestAnchors
from model.evaluation.baselines.piecewise_field import PiecewiseField
from model.evaluation.baselines.prior_mean import PriorMean
from model.evaluation.baselines.two_stage import TwoStage
from model.evaluation.matphys import MatPhysMethod
from model.evaluation.synchronised import Synchronised

OPEN_LOOP = "-open-loop"
"""Ends the name of a predictor whose twin is not led through what was seen."""
LED = "-synchronised"
"""Ends the name of a baseline whose twin is led as a predictor's is."""
SPRING_MASS: tuple[type[Method], ...] = (PriorMean, TwoStage, PiecewiseField, NearestAnchors)
"""Baselines that can be led."""


def _ours() -> Method:
    return Synchronised(MatPhysMethod())


ALL: Mapping[str, Callable[[], Method]] = {
    MatPhysMethod.name: _ours,
    MatPhysMethod.name + OPEN_LOOP: MatPhysMethod,
    **{method.name: method for method in ALL_METHODS},
}
"""What `all` stands for, in the order of the tables."""


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
    pairs = [_method(name) for word in words for name in (ALL if word == "all" else [word])]
    if len(dict(pairs)) < len(pairs):
        raise InputError(f"--methods {written}: a method is named twice: give each its own name")
    return dict(pairs)


def _method(word: str) -> tuple[str, Method]:
    name, given, file = word.partition("=")
    if given:
        predictor = MatPhysMethod(Path(file))
        return name, predictor if name.endswith(OPEN_LOOP) else Synchronised(predictor)
    name = name.replace("_", "-")
    if name in ALL:
        return name, ALL[name]()
    led = {method.name + LED: method for method in SPRING_MASS}
    if name in led:
        return name, Synchronised(led[name]())
    raise InputError(
        f"--methods: no method {name!r}: choose from {', '.join([*ALL, *led])}, or give NAME=FILE"
    )
