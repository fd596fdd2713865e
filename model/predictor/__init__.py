"""A case → parameters: one forward pass of a trained network, or the prior's means."""

from model.predictor.base import ParameterPredictor
from model.predictor.prior_mean import PriorMeanPredictor
from model.predictor.trained import TrainedPredictor

ALL_PREDICTORS: tuple[type[ParameterPredictor], ...] = (TrainedPredictor, PriorMeanPredictor)
"""The default first."""

__all__ = ["ALL_PREDICTORS", "ParameterPredictor", "PriorMeanPredictor", "TrainedPredictor"]
