import numpy as np

from model.evaluation.baselines.hold_last import HoldLast
from model.evaluation.baselines.prior_mean import PriorMean


def test_it_believes_the_priors_and_does_not_look(make_case, hide, errors):
    case = make_case(frames=12)
    fitted = PriorMean().fit(hide(case))
    wanted = [prior.properties["stiffness"] for prior in case.priors]
    assert np.allclose(np.exp(fitted.part_belief.log_modulus), [each.mean for each in wanted])
    assert np.allclose(fitted.part_belief.log_spread, [each.spread for each in wanted])
    case.observation.points[1:] += 1.0
    again = PriorMean().fit(hide(case))
    assert np.array_equal(again.parameters.stiffness, fitted.parameters.stiffness)


def test_it_beats_a_shape_that_stays(make_case, hide, errors):
    case = make_case(frames=12)
    assert errors(case, PriorMean().fit(hide(case)))[0] < errors(case, HoldLast().fit(hide(case)))[0]
