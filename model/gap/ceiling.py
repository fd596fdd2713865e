"""What any missing physics could explain: the refitted twin with a flexible residual force."""

from dataclasses import replace

from model.gap.confirm import Fitted, fitted
from model.gap.residual_force import RESIDUAL
from model.gap.study import Study

STEPS = 5
"""Of Gauss and Newton: the force is linear in its weights, and each step costs some forty slow rollouts."""
DEAREST = 4
"""A force that needs so many times the substeps of the twin without it is given up: it is lost to its own
stiffness, and to find that out takes longer than all else."""


def ceiling(study: Study, plain: Fitted) -> Fitted:
    """Fit the flexible force, and the twin's parameters with it, to the frames that all fits see.

    It starts from the refitted twin without any such force, so that it explains those frames at least as
    well. What it has learned may still not hold later: `closure` then reports the refitted twin's error.
    Nothing is believed of the twin beside it: a plain twin that is held near what is usual would keep a force
    from explaining what goes with an unusual one.

    Args:
        study: The plain twin's first fit.
        plain: From `confirm.refit`.
    """
    able = tuple(effect for effect in (kind() for kind in RESIDUAL) if effect.unable(plain.world) is None)
    hypothesis = replace(study.plain, effects=able, believing=False)
    silent = {name: quantity.start for name, quantity in hypothesis.quantities.items()}
    start = study.misfit.of(hypothesis).coordinates.vector({**silent, **plain.estimate.values})
    most = DEAREST * plain.misfit.needs(plain.estimate.vector)
    return fitted(study, hypothesis, start, STEPS, slopes=False, most=most)
