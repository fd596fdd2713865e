"""Material priors: one part on the keyframe → what it is made of."""

from model.priors.base import PriorClient
from model.priors.stub import StubPrior

ALL_PRIORS: tuple[type[PriorClient], ...] = (StubPrior,)
"""The default first."""

__all__ = ["ALL_PRIORS", "PriorClient", "StubPrior"]
