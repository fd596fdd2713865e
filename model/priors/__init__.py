"""Material priors: one part on the keyframe → what it is made of."""

from model.priors.base import PriorClient
from model.priors.openai import OpenAIPrior
from model.priors.overlay import overlay, overlay_png
from model.priors.stub import StubPrior

ALL_PRIORS: tuple[type[PriorClient], ...] = (StubPrior, OpenAIPrior)
"""The default first."""

__all__ = ["ALL_PRIORS", "OpenAIPrior", "PriorClient", "StubPrior", "overlay", "overlay_png"]
