"""The parameters of a generated case's twin as its truth has them: what no predictor can beat by much."""

from dataclasses import replace

import numpy as np

from model.errors import InputError
from model.predictor.lattice import lattice_stiffness
from model.predictor.prior_mean import PriorMeanPredictor
from model.predictor.prior_means import volumes
from model.scenes.case import Case
from model.types import Estimate, Parameters


def true_parameters(case: Case) -> Parameters:
    """Every part's true modulus on the twin's springs, and the true global parameters.

    Raises:
        InputError: the case has no truth.
    """
    truth = case.truth
    if truth is None:
        raise InputError(f"case {case.name}: its truth is not known")
    topology, seen = case.topology, case.observation
    exact = tuple(
        replace(prior, properties={**prior.properties, "stiffness": Estimate(float(modulus), 0.0, "Pa")})
        for prior, modulus in zip(case.priors, truth.modulus, strict=True)
    )
    guess = PriorMeanPredictor().from_priors(
        topology, exact, case.shape_class, seen.gravity, seen.ground_height
    )
    stiffness = lattice_stiffness(topology, truth.modulus, volumes(topology, case.priors), case.shape_class)
    names = ("dashpot_damping", "drag_rate", "friction", "restitution")
    exactly = {
        name: replace(guess.globals[name], value=float(getattr(truth, name)), std=None) for name in names
    }
    return replace(guess, stiffness=stiffness.astype(np.float32), globals={**guess.globals, **exactly})
