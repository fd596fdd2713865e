"""Our own method in the table: the trained predictor, one forward pass."""

import hashlib
from functools import cache
from pathlib import Path
from typing import ClassVar

import numpy as np

from model.errors import InputError
from model.evaluation.baselines.base import Method, PartBelief, Twin
from model.predictor.trained import SHIPPED, TrainedPredictor
from model.scenes.case import Case


class MatPhysMethod(Method):
    """A predictor that `matphys fit` has made; nothing is fitted to the clip.

    Args:
        path: Its weights; None: those that come with the package.

    Raises:
        InputError: there is no such file.
    """

    name: ClassVar[str] = "matphys"

    def __init__(self, path: Path | None = None) -> None:
        """See the class."""
        self.path = path or SHIPPED
        if not self.path.is_file():
            raise InputError(f"{self.path}: no such predictor: make one with `matphys fit`")

    def fit(self, case: Case) -> Twin:
        """Look at the frames before the split and predict."""
        parameters, prediction = _predictor(self.path).believe(case)
        belief = PartBelief(
            prediction.part_log_modulus.numpy().astype(np.float64),
            prediction.part_log_spread.numpy().astype(np.float64),
        )
        return Twin(case.topology, parameters, belief)

    def identity(self) -> str:
        """With the digest of its weights."""
        digest = hashlib.sha256(self.path.read_bytes()).hexdigest()
        return f"{super().identity()} {digest[:16]}"

    def trained_on(self) -> str | None:
        """As its card says."""
        index = _predictor(self.path).trained.about.data.get("index")
        return None if index is None else str(index)


@cache
def _predictor(path: Path) -> TrainedPredictor:
    """Read once in each process."""
    return TrainedPredictor(path)
