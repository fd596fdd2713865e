import numpy as np

from model.evaluation.baselines.hold_last import HoldLast
from model.evaluation.hidden import answer
from model.evaluation.metrics import matched_track_error, track_error


def test_every_frame_but_the_first_is_the_shape_last_seen(make_case, hide):
    case = hide(make_case(frames=10))
    case.observation.points[case.split - 1, 3] = np.nan
    made = HoldLast().fit(case).predict(case)
    assert made.shape == case.observation.points.shape
    expected = case.observation.points[case.split - 1].copy()
    expected[3] = case.observation.points[case.split - 2, 3]
    assert np.array_equal(made[0], case.rest)
    assert np.array_equal(made[1], expected)
    assert np.array_equal(made[-1], expected)


def test_of_another_interaction_it_knows_the_rest_shape(make_case, hide):
    case, other = hide(make_case(frames=10)), hide(make_case(frames=8, lift=0.1, name="other"))
    assert np.array_equal(HoldLast().fit(case).predict(other)[5], other.rest)


def test_points_are_matched_where_they_were_and_not_where_they_were_last_seen(make_case, hide):
    case = make_case(frames=10)
    made, truth = HoldLast().fit(hide(case)).predict(hide(case)), answer(case)
    matched = matched_track_error(case.rest, truth, made)
    np.testing.assert_allclose(matched[case.split :], track_error(truth, made)[case.split :], rtol=1e-6)
