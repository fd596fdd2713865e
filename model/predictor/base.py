"""Topology and priors → parameters: the seam the trained predictor will fill."""

from collections.abc import Sequence
from typing import ClassVar, Protocol, runtime_checkable

from model.types import Calibration, Frames, Masks, MaterialPrior, Parameters, ShapeClass, Topology, Tracks


@runtime_checkable
class ParameterPredictor(Protocol):
    """Predicts the mechanics of a topology in one forward pass."""

    name: ClassVar[str]
    version: ClassVar[str]
    weights: str | None

    def __call__(
        self,
        topology: Topology,
        priors: Sequence[MaterialPrior],
        shape_class: ShapeClass,
        calibration: Calibration,
        frames: Frames,
        masks: Masks,
        tracks: Tracks,
    ) -> Parameters:
        """Predict.

        Args:
            topology: What to parametrise.
            priors: One per part, in the order of the labels.
            shape_class: Sheet, rope or solid: how springs share the modulus.
            calibration: Gravity and ground.
            frames: The clip, for methods that look at motion.
            masks: Object and hand.
            tracks: 2D tracks of the object.
        """
        ...
