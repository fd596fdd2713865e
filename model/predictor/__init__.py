"""Topology and priors → parameters; until a trained predictor is there, the prior's means."""

from model.predictor.base import ParameterPredictor
from model.predictor.prior_mean import PriorMeanPredictor

ALL_PREDICTORS: tuple[type[ParameterPredictor], ...] = (PriorMeanPredictor,)

__all__ = ["ALL_PREDICTORS", "ParameterPredictor", "PriorMeanPredictor"]
