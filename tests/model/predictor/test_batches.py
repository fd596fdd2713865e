from dataclasses import replace

import numpy as np
import pytest
import torch

from model.predictor.batches import Example, make_batch, true_values
from model.predictor.lattice import lattice_stiffness
from model.scenes.true_parameters import true_parameters
from model.scenes.world.truth import part_volumes


def test_truth_is_in_the_coordinates_of_a_prediction(make_case):
    case = make_case(modulus=(4e3, 4e4))
    truth = true_values(case, 2)
    np.testing.assert_allclose(truth.part_log_modulus, np.log([4e3, 4e4]), rtol=1e-6)
    part = case.topology.part[case.topology.springs]
    np.testing.assert_allclose(truth.log_modulus[(part == 1).all(1)], np.log(4e4), rtol=1e-6)
    values = truth.globals[0]
    assert float(values[0]) == pytest.approx(np.log(case.truth.dashpot_damping), rel=1e-5)
    assert float(values[3].sigmoid()) == pytest.approx(case.truth.restitution, rel=1e-5)


def test_springs_across_a_border_are_taught_as_the_world_has_them(make_case):
    case = make_case(modulus=(4e3, 4e5))
    part = case.topology.part[case.topology.springs]
    border = part[:, 0] != part[:, 1]
    logs = true_values(case, 2).log_modulus.numpy()
    np.testing.assert_allclose(logs[border], np.log(4e4), rtol=1e-6)
    density = np.array([prior.properties["density"].mean for prior in case.priors])
    volume = part_volumes(case.topology, density)
    world = lattice_stiffness(case.topology, case.truth.modulus, volume, case.shape_class)
    unit = lattice_stiffness(case.topology, np.ones(2), volume, case.shape_class)
    np.testing.assert_allclose(logs, np.log(world / unit), rtol=1e-6)
    np.testing.assert_allclose(true_parameters(case).stiffness, world, rtol=1e-5)


def test_restitution_at_its_bounds_has_a_finite_logit(make_case):
    case = make_case()
    for restitution in (0.0, 1.0):
        extreme = replace(case, truth=replace(case.truth, restitution=restitution))
        assert bool(torch.isfinite(true_values(extreme, 2).globals).all())


def test_without_truth_nothing_is_known(make_case):
    truth = true_values(replace(make_case(), truth=None), 2)
    assert bool(truth.log_modulus.isnan().all())
    assert truth.part_log_modulus.shape == (2,)
    assert bool(truth.globals.isnan().all())


def test_a_batch_keeps_the_order_of_its_examples(make_case, sample_of):
    cases = [make_case(seed=seed, modulus=(1e3 * (seed + 1), 1e4)) for seed in range(3)]
    batch = make_batch([Example(case, sample_of(case), true_values(case, 2)) for case in cases])
    assert len(batch) == 3
    assert batch.cases == tuple(cases)
    np.testing.assert_allclose(batch.truth.part_log_modulus[::2].exp(), [1e3, 2e3, 3e3], rtol=1e-4)
    assert batch.sample.part_scene.tolist() == [0, 0, 1, 1, 2, 2]
    moved = batch.to(torch.device("cpu"))
    assert moved.cases == batch.cases
