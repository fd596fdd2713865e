"""Our own method in the table: the trained predictor, one forward pass."""

import hashlib
from functools import cache
from pathlib import Path
from typing import ClassVar

import numpy as np

from model.encoders import ALL_MOTION_ENCODERS
from model.errors import InputError
from model.evaluation.baselines.base import Method, PartBelief, Twin
from model.predictor.checkpoint import load_predictor
from model.predictor.trained import SHIPPED, TrainedPredictor
from model.registry import by_name
from model.scenes.case import Case


class MatPhysMethod(Method):
    """A predictor that `matphys fit` has made; nothing is fitted to the clip.

    Of a folder of predictors, each of which left out other objects of one folder of cases, the one is asked
    that left out the object in question.

    Args:
        path: Its weights, or such a folder; None: those that come with the package.

    Raises:
        InputError: there is no such file, nothing in the folder, or a predictor that looks at pictures, which
            no method is given.
    """

    name: ClassVar[str] = "matphys"

    def __init__(self, path: Path | None = None) -> None:
        """See the class."""
        self.path = path or SHIPPED
        self._files = tuple(sorted(self.path.glob("*.safetensors"))) if self.path.is_dir() else (self.path,)
        if not self._files or not self._files[0].is_file():
            raise InputError(f"{self.path}: no such predictor: make one with `matphys fit`")
        for file in self._files:
            _check_needs_no_pictures(file)

    def fit(self, case: Case) -> Twin:
        """Look at the frames before the split and predict.

        Raises:
            InputError: every predictor of the folder was trained on the object.
        """
        parameters, prediction = self._asked(case.object_name).believe(case)
        belief = PartBelief(
            prediction.part_log_modulus.numpy().astype(np.float64),
            prediction.part_log_spread.numpy().astype(np.float64),
        )
        return Twin(case.topology, parameters, belief)

    def identity(self) -> str:
        """With its weights."""
        return f"{super().identity()} {self.weights()}"

    def weights(self) -> str:
        """Digest of its files."""
        digest = hashlib.sha256()
        for file in self._files:
            digest.update(file.read_bytes())
        return digest.hexdigest()[:16]

    def knew(self, source: str, object_name: str) -> bool:
        """As its card says: see `Trained.knows`."""
        return self._asked(object_name).trained.knows(object_name, source)

    def _asked(self, object_name: str) -> TrainedPredictor:
        if self.path.is_file():
            return _predictor(self.path, _digest(self.path))
        for file in self._files:
            predictor = _predictor(file, _digest(file))
            if predictor.trained.leaves_out(object_name):
                return predictor
        raise InputError(f"{self.path}: no predictor in it left out {object_name}: train with --data.folds")


def _check_needs_no_pictures(file: Path) -> None:
    encoder = load_predictor(file).about.encoder
    if by_name(ALL_MOTION_ENCODERS, encoder, "motion encoder").needs_images:
        raise InputError(
            f"{file}: its motion encoder {encoder} looks at pictures, which no method is given here: "
            "evaluate a predictor that was trained without configs/videomae.yaml"
        )


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


@cache
def _predictor(path: Path, digest: str) -> TrainedPredictor:
    """Read once in each process, and again when it was written again."""
    return TrainedPredictor(path)
