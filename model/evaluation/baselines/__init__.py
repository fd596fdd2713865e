"""Methods that a predictor is measured against, one per file."""

from model.evaluation.baselines.base import Fitted, Method, PartBelief, Twin, carried
from model.evaluation.baselines.graph_dynamics import GraphDynamics
from model.evaluation.baselines.hold_last import HoldLast
from model.evaluation.baselines.last_residual import LastResidual
from model.evaluation.baselines.nearest_anchors import NearestAnchors
from model.evaluation.baselines.piecewise_field import PiecewiseField
from model.evaluation.baselines.prior_mean import PriorMean
from model.evaluation.baselines.two_stage import TwoStage

ALL_METHODS: tuple[type[Method], ...] = (
    HoldLast,
    LastResidual,
    PriorMean,
    TwoStage,
    PiecewiseField,
    NearestAnchors,
    GraphDynamics,
)
"""What the table compares with, in its order."""

__all__ = ["ALL_METHODS", "Fitted", "Method", "PartBelief", "Twin", "carried"]
