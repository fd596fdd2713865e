"""What baselines are shown of a case, and how far off they are."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from model.evaluation.baselines.base import Fitted
from model.scenes.case import Case


def _hide(case: Case) -> Case:
    points = case.observation.points.copy()
    points[case.split :] = np.nan
    return replace(case, observation=replace(case.observation, points=points), complete=None, truth=None)


def _errors(case: Case, fitted: Fitted) -> tuple[float, float]:
    assert case.complete is not None
    apart = np.linalg.norm(fitted.predict(_hide(case)) - case.complete, axis=2)
    return float(apart[1 : case.split].mean()), float(apart[case.split :].mean())


@pytest.fixture(scope="session")
def hide() -> Callable[[Case], Case]:
    """The case as the protocol hands it to a method: without future and truth."""
    return _hide


@pytest.fixture(scope="session")
def errors() -> Callable[[Case, Fitted], tuple[float, float]]:
    """Mean distance from the truth [m]: of the frames that were seen, and of the future."""
    return _errors
