from dataclasses import replace

import numpy as np
import pytest

from model.errors import InputError
from model.scenes.replay import replay
from model.scenes.true_parameters import true_parameters
from model.scenes.world.cases import draw_cases


def test_true_parameters_replay_what_a_twin_of_them_did(make_case):
    case = make_case(frames=12, modulus=(1e4, 1e4))
    moved = replay(case, true_parameters(case))
    np.testing.assert_allclose(moved, case.complete, atol=2e-3)


def test_they_are_the_truth_number_by_number(make_case):
    case = make_case(frames=4)
    known = true_parameters(case)
    for name in ("dashpot_damping", "drag_rate", "friction", "restitution"):
        assert known.globals[name].value == getattr(case.truth, name)
    stiffer = true_parameters(replace(case, truth=replace(case.truth, modulus=2.0 * case.truth.modulus)))
    np.testing.assert_allclose(stiffer.stiffness, 2.0 * known.stiffness, rtol=1e-5)


def test_without_truth_there_are_none(make_case):
    with pytest.raises(InputError, match="its truth is not known"):
        true_parameters(replace(make_case(frames=4), truth=None))


def test_the_truth_follows_the_finer_world_closer_than_wrong_moduli_do():
    worse = []
    for index in range(3):
        (case,) = draw_cases(11, index, "plush", interactions=1)
        error = {}
        for scale in (1.0, 6.0, 1.0 / 6.0):
            scaled = replace(case, truth=replace(case.truth, modulus=scale * case.truth.modulus))
            error[scale] = np.linalg.norm(
                replay(case, true_parameters(scaled)) - case.complete, axis=2
            ).mean()
        worse.append(min(error[6.0], error[1.0 / 6.0]) / error[1.0])
    assert np.median(worse) > 1.3
