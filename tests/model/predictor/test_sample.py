from dataclasses import fields, replace

import numpy as np
import pytest
import torch

from model.errors import InputError
from model.predictor.geometry import describe_geometry
from model.predictor.lattice import lattice_stiffness
from model.predictor.motion_features import MotionFeatures
from model.predictor.prior_means import volumes
from model.predictor.sample import Prediction, make_sample


@pytest.fixture(scope="module")
def case(make_case):
    return make_case(frames=3)


def test_a_modulus_on_the_unit_stiffness_is_the_stiffness_of_the_lattice(case, sample_of):
    sample = sample_of(case)
    modulus = torch.tensor([2e3, 9e4])
    found = (sample.log_unit_stiffness + modulus.log()[sample.edge_part].mean(dim=1)).exp()
    volume = volumes(case.topology, case.priors)
    expected = lattice_stiffness(case.topology, modulus.double().numpy(), volume, "solid")
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_the_prior_is_told_as_it_is(case, sample_of):
    sample = sample_of(case)
    for row, prior in enumerate(case.priors):
        np.testing.assert_allclose(sample.distribution[row], prior.distribution, rtol=1e-6)
        assert float(sample.prior_log_modulus[row].exp()) == pytest.approx(
            prior.properties["stiffness"].mean, rel=1e-5
        )
        assert float(sample.prior_log_spread[row]) == pytest.approx(prior.properties["stiffness"].spread)
    assert float(sample.part_share.sum()) == pytest.approx(1.0)
    assert sample.case_count == 1
    assert sample.part_scene.tolist() == [0, 0]


def test_a_geometry_that_is_known_already_changes_nothing(case):
    motion = MotionFeatures(np.zeros((len(case.topology.points), 2), np.float32), np.zeros(2, np.float32))
    known = describe_geometry(case.topology, 2, "solid", 0.0)
    arguments = (case.topology, case.priors, "solid", (0.0, 0.0, -9.81), 0.0, motion)
    first, second = make_sample(*arguments), make_sample(*arguments, geometry=known)
    for (name, one), (_, other) in zip(first.tensors(), second.tensors(), strict=True):
        assert torch.equal(one, other), name


def test_motion_of_another_body_is_refused(case):
    motion = MotionFeatures(np.zeros((5, 2), np.float32), np.zeros(2, np.float32))
    with pytest.raises(InputError, match="72 mass points, but motion of 5"):
        make_sample(case.topology, case.priors, "solid", (0.0, 0.0, -9.81), 0.0, motion)


def test_numbers_take_another_type_and_indices_stay(case, sample_of):
    moved = sample_of(case).to(torch.float64)
    kinds = {name: value.dtype for name, value in moved.tensors()}
    indices = {"edges", "edge_part", "point_part", "part_scene", "grips"}
    assert {name for name, kind in kinds.items() if kind == torch.int64} == indices
    assert {kind for name, kind in kinds.items() if name not in indices} == {torch.float64}
    assert sample_of(case).to("meta").edges.device.type == "meta"


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1e3])
def test_what_stands_for_no_number_is_named(value):
    shapes = {"global_mean": (1, 4), "global_log_spread": (1, 4)}
    good = Prediction(**{one.name: torch.ones(shapes.get(one.name, (2,))) for one in fields(Prediction)})
    assert good.lost == []
    bare = replace(good, log_controller_stiffness=torch.zeros(0))  # nothing is held
    assert bare.lost == []
    assert replace(bare, part_log_modulus=torch.tensor([1.0, value])).lost == ["part_log_modulus"]
