from dataclasses import replace

import numpy as np
import pytest
import torch

from model.predictor.parametrisation import to_parameters
from model.predictor.sample import Prediction
from model.scenes.replay import replay

GRAVITY = (0.0, 0.0, -9.81)


@pytest.fixture(scope="module")
def case(make_case):
    return make_case(frames=4)


@pytest.fixture(scope="module")
def sample(case, sample_of):
    return sample_of(case)


def said(sample, log_modulus=9.0, mean=(-3.0, -1.0, -0.5, -2.0), spread=(0.2, 0.3, 0.1, 0.4)):
    """A prediction of these numbers."""
    springs, parts = len(sample.edges), len(sample.part_scene)
    return Prediction(
        log_modulus=torch.full((springs,), log_modulus),
        log_modulus_spread=torch.full((springs,), 0.3),
        part_log_modulus=torch.full((parts,), log_modulus),
        part_log_spread=torch.full((parts,), 0.3),
        log_controller_stiffness=torch.full((len(sample.grips),), 3.0),
        global_mean=torch.tensor([mean]),
        global_log_spread=torch.tensor([spread]),
    )


def test_numbers_come_out_in_their_units(case, sample):
    found = to_parameters(said(sample), sample, case.topology, GRAVITY, 0.0)
    assert found.warnings == ()
    np.testing.assert_allclose(found.stiffness, np.exp(9.0 + sample.log_unit_stiffness.numpy()), rtol=1e-5)
    np.testing.assert_allclose(found.controller_stiffness, np.exp(3.0), rtol=1e-5)
    values = {name: entry.value for name, entry in found.globals.items()}
    assert values["dashpot_damping"] == pytest.approx(np.exp(-3.0))
    assert values["drag_rate"] == pytest.approx(np.exp(-1.0))
    assert values["friction"] == pytest.approx(np.exp(-0.5))
    assert values["restitution"] == pytest.approx(1 / (1 + np.exp(2.0)))
    assert values["ground_height"] == 0.0
    assert found.globals["drag_rate"].source == "predicted"
    assert found.globals["dashpot_damping"].unit == "N*s/m"
    assert "ground_height" not in to_parameters(said(sample), sample, case.topology, GRAVITY, None).globals


def test_spreads_are_carried_over_to_units(case, sample):
    rng = np.random.default_rng(0)
    found = to_parameters(said(sample), sample, case.topology, GRAVITY, 0.0).globals
    small = to_parameters(
        said(sample, spread=(0.02, 0.02, 0.02, 0.02)), sample, case.topology, GRAVITY, 0.0
    ).globals
    assert found["friction"].std == pytest.approx(0.1 * np.exp(-0.5), rel=1e-5)
    drawn = 1 / (1 + np.exp(2.0 - 0.02 * rng.standard_normal(100_000)))
    assert small["restitution"].std == pytest.approx(drawn.std(), rel=0.02)
    drawn = np.exp(-1.0 + 0.02 * rng.standard_normal(100_000))
    assert small["drag_rate"].std == pytest.approx(drawn.std(), rel=0.02)


def test_stiffer_than_affordable_is_limited_and_said(case, sample):
    free = to_parameters(said(sample), sample, case.topology, GRAVITY, 0.0)
    hard = to_parameters(said(sample, log_modulus=20.0), sample, case.topology, GRAVITY, 0.0)
    assert "so that 250 substeps per frame suffice" in hard.warnings[0]
    ratio = float(hard.stiffness[0] / free.stiffness[0])
    assert 1.0 < ratio < np.exp(11.0)
    stated = float(hard.warnings[0].split(" to ")[3].split(" Pa")[0])
    assert stated == pytest.approx(np.exp(9.0) * ratio, rel=0.06)
    held = float(hard.controller_stiffness[0] / free.controller_stiffness[0])
    assert held == pytest.approx(ratio * np.exp(-11.0), rel=1e-4)  # both were said to be e³ N/m
    assert hard.globals["dashpot_damping"].value < free.globals["dashpot_damping"].value
    assert np.isfinite(replay(case, hard)).all()


def test_the_true_moduli_give_the_true_motion(case, sample):
    moduli = torch.log(torch.as_tensor(case.truth.modulus, dtype=torch.float32))
    truth, ends = case.truth, sample.edge_part
    mean = [np.log(truth.dashpot_damping), np.log(truth.drag_rate), np.log(truth.friction)]
    mean.append(np.log(truth.restitution / (1 - truth.restitution)))
    mixed = moduli[ends].mean(dim=1)
    # the densities of the priors are those that the truth was made with
    exact = replace(
        said(sample, mean=[float(one) for one in mean]),
        log_modulus=mixed,
        log_controller_stiffness=sample.log_grip_anchor
        + (moduli - sample.prior_log_modulus)[sample.point_part[sample.grips]],
    )
    found = to_parameters(exact, sample, case.topology, GRAVITY, 0.0)
    np.testing.assert_allclose(replay(case, found), case.complete, atol=2e-4)
