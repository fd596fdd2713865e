"""What a method is given of a case: the truth, and what it is to predict, are not in it."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float32

from model.scenes.case import Case
from model.types import Array, MaterialPrior


def seen_until_split(case: Case) -> Case:
    """The case as it is learned from: observed points are NaN from `split` on, nothing says what is true.

    Controls stay: they are what is done to the object, not what it does.
    """
    return _hidden(case, case.split)


def unseen(case: Case, priors: tuple[MaterialPrior, ...]) -> Case:
    """Another interaction, as its motion is asked for: nothing of it was observed.

    Args:
        case: The other interaction.
        priors: What is said of the object in the case that was learned from: another clip brings no news.
    """
    return replace(_hidden(case, 0), priors=priors)


def answer(case: Case) -> Float32[Array, "T N 3"]:
    """Where the observed points really were [m]; without a truth what was measured, NaN where nothing was."""
    return case.observation.points if case.complete is None else case.complete


def _hidden(case: Case, known: int) -> Case:
    points = np.full_like(case.observation.points, np.nan)
    points[:known] = case.observation.points[:known]
    return replace(case, observation=replace(case.observation, points=points), complete=None, truth=None)
