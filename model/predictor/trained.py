"""Parameters from what was seen, believed and built: the network that was trained."""

from dataclasses import replace
from pathlib import Path

import torch
from jaxtyping import UInt8

from model.encoders import ALL_MOTION_ENCODERS
from model.encoders.motion import MotionEncoder
from model.errors import InputError
from model.one_thread import one_thread
from model.predictor.base import ParameterPredictor
from model.predictor.checkpoint import Trained, load_predictor
from model.predictor.motion import describe_motion
from model.predictor.parametrisation import to_parameters
from model.predictor.reference import compared_frames
from model.predictor.sample import Prediction, Sample, make_sample
from model.registry import by_name
from model.scenes.case import Case
from model.types import Array, Parameters

SHIPPED = Path(__file__).with_name("predictor.safetensors")
"""What comes with the package; its card is beside it."""


class TrainedPredictor(ParameterPredictor):
    """One forward pass of a trained network over motion, materials and geometry.

    Args:
        path: A predictor that `matphys fit` has made; None: the one that comes with the package.
        encoder: What describes motion; None: the one it was trained with, made by its name. Encoders with
            weights of their own have to be given.

    Raises:
        InputError: there is no such file, or it was trained with another encoder.
    """

    name = "matphys"
    version = "1"

    def __init__(self, path: Path | None = None, encoder: MotionEncoder | None = None) -> None:
        """See the class."""
        self.trained: Trained = load_predictor(path or SHIPPED)
        expected = self.trained.encoder
        self.encoder = encoder or by_name(ALL_MOTION_ENCODERS, expected.name, "motion encoder")()
        found = self.encoder.identity
        if found != expected:
            raise InputError(f"{path or SHIPPED}: trained with motion encoder {expected}, but given {found}")
        self.weights: str | None = self.trained.sha256

    def __call__(self, case: Case, images: UInt8[Array, "T H W 3"] | None = None) -> Parameters:
        """Predict; see `ParameterPredictor`."""
        return self.believe(case, images)[0]

    def believe(
        self, case: Case, images: UInt8[Array, "T H W 3"] | None = None
    ) -> tuple[Parameters, Prediction]:
        """The parameters, and the means and spreads that they were taken from.

        Raises:
            InputError: the case has no motion to be described, or what is predicted is no number.
        """
        with one_thread(), torch.no_grad():
            sample = self.sample(case, images)
            prediction: Prediction = self.trained.network(sample)
        if prediction.lost:
            lost = ", ".join(prediction.lost)
            raise InputError(f"what is predicted for {lost} is not finite: the network's training diverged")
        seen = case.observation
        found = to_parameters(prediction, sample, case.topology, seen.gravity, seen.ground_height)
        return replace(found, warnings=(*found.warnings, *self._doubts(case))), prediction

    def sample(self, case: Case, images: UInt8[Array, "T H W 3"] | None = None) -> Sample:
        """What the network reads of a case."""
        seen = case.observation
        motion = describe_motion(
            case.topology,
            case.shape_class,
            case.rest,
            case.anchors,
            seen,
            case.camera,
            case.split,
            self.encoder,
            images,
        )
        return make_sample(
            case.topology, case.priors, case.shape_class, seen.gravity, seen.ground_height, motion
        )

    def _doubts(self, case: Case) -> tuple[str, ...]:
        """What of the motion was seen, and did not tell all that it could."""
        springs, times = len(case.topology.springs), case.observation.times
        compared = compared_frames(springs, case.split)
        if not self.encoder.needs_references or compared >= case.split:
            return ()
        return (
            f"stiffness was judged by the motion up to {times[compared - 1]:.2g} s alone: {springs} springs "
            "are too many for more; fewer --points leave room for all of it",
        )
