from dataclasses import replace

import numpy as np

from model.evaluation.baselines.last_residual import LastResidual, residuals
from model.evaluation.baselines.prior_mean import PriorMean
from model.types import Camera


def test_the_future_begins_where_the_object_was_last_seen(make_case, hide):
    case = hide(make_case(frames=12))
    made = LastResidual().fit(case).predict(case)
    prior = PriorMean().fit(case).predict(case)
    residual = case.observation.points[case.split - 1] - prior[case.split - 1]
    assert np.abs(residual).max() > 1e-4
    assert np.allclose(made[case.split :], prior[case.split :] + residual, atol=1e-6)
    assert np.array_equal(made[: case.split], prior[: case.split])


def test_of_another_interaction_there_is_no_residual(make_case, hide):
    case, other = hide(make_case(frames=12)), hide(make_case(frames=12, lift=0.1, name="other"))
    made = LastResidual().fit(case).predict(other)
    assert np.array_equal(made, PriorMean().fit(case).predict(other))


def test_a_point_out_of_sight_takes_its_neighbours_residual(make_case, hide):
    case = hide(make_case(frames=12))
    still = np.repeat(case.rest[None], 12, axis=0)
    offset = np.array([0.01, 0.0, 0.0], np.float32)
    case.observation.points[: case.split] = still[: case.split] + offset
    case.observation.points[2:, 7] = np.nan
    assert np.allclose(residuals(case, still), offset, atol=1e-6)


def test_with_one_camera_depth_is_not_measured(make_case, hide):
    case = hide(make_case(frames=12))
    pose = np.eye(4)
    pose[:3, 3] = case.rest.mean(axis=0) - (0.0, 0.0, 1000.0)
    case = replace(case, camera=Camera(np.eye(3), pose, 10, 10))
    still = np.repeat(case.rest[None], 12, axis=0)
    case.observation.points[: case.split] = still[: case.split] + np.float32([0.01, 0.0, 0.02])
    assert np.allclose(residuals(case, still), [0.01, 0.0, 0.0], atol=1e-5)
