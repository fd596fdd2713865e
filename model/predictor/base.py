"""A case → parameters: the seam every predictor fills."""

from typing import ClassVar, Protocol, runtime_checkable

from jaxtyping import UInt8

from model.scenes.case import Case
from model.types import Array, Parameters


@runtime_checkable
class ParameterPredictor(Protocol):
    """Predicts the mechanics of a topology in one forward pass."""

    name: ClassVar[str]
    version: ClassVar[str]
    weights: str | None

    def __call__(self, case: Case, images: UInt8[Array, "T H W 3"] | None = None) -> Parameters:
        """Predict.

        Args:
            case: What to parametrise, what its parts are believed to be made of, and how it was seen to move
                until `case.split`; nothing later and no truth is looked at.
            images: RGB frames of `case.camera`, one per time, for predictors that look at them.
        """
        ...
