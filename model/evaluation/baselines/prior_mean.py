"""What the material prior says, and no look at the motion."""

from typing import ClassVar

import numpy as np

from model.evaluation.baselines.base import Method, PartBelief, Twin
from model.predictor.prior_mean import PriorMeanPredictor
from model.scenes.case import Case


class PriorMean(Method):
    """Each part has its prior's mean modulus, the object its prior's mean global parameters."""

    name: ClassVar[str] = "prior-mean"

    def fit(self, case: Case) -> Twin:
        """Parametrise the topology; the observation is not looked at."""
        seen = case.observation
        parameters = PriorMeanPredictor().from_priors(
            case.topology, case.priors, case.shape_class, seen.gravity, seen.ground_height
        )
        stiffness = [prior.properties["stiffness"] for prior in case.priors]
        belief = PartBelief(
            np.log([estimate.mean for estimate in stiffness]),
            np.array([estimate.spread for estimate in stiffness], np.float64),
        )
        return Twin(case.topology, parameters, belief)
