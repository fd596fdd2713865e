from dataclasses import replace

import numpy as np
import pytest
import torch

from model.errors import InputError
from model.predictor.batches import Example, TrueValues, make_batch, true_values
from model.predictor.calibration import LEAST, calibrate, deviations
from model.predictor.losses import covered
from model.predictor.options import NetworkOptions


@pytest.fixture
def network():
    torch.manual_seed(0)
    return NetworkOptions(dim=8, layers=1, heads=2).build(5, 3).eval()


def batches(network, make_case, sample_of, error, looks=30):
    """Truths that deviate from what the network predicts by `error` of its spreads, normally distributed."""
    case, rng = make_case(frames=4), np.random.default_rng(0)
    made = []
    for seed in range(looks):
        sample = sample_of(case, seed=seed)
        with torch.no_grad():
            said = network(sample)
        noise = [torch.as_tensor(rng.normal(size=n), dtype=torch.float32) for n in (2, 4)]
        truth = TrueValues(
            said.log_modulus,
            said.part_log_modulus + error * said.part_log_spread * noise[0],
            said.global_mean + error * said.global_log_spread * noise[1],
        )
        made.append(make_batch([Example(case, sample, truth)]))
    return made


def test_spreads_are_set_so_that_intervals_hold_what_they_should(network, make_case, sample_of):
    data = batches(network, make_case, sample_of, error=2.0)
    found = calibrate(network, data)
    assert found.parts == pytest.approx(2.0, rel=0.3)
    assert found.looks == 30
    with torch.no_grad():
        inside = [
            covered(said.part_log_modulus, said.part_log_spread, batch.truth.part_log_modulus)
            for batch, said in ((batch, network(batch.sample)) for batch in data)
        ]
    assert float(torch.cat(inside).float().mean()) == pytest.approx(0.9, abs=0.03)


def test_means_stay_and_a_second_calibration_changes_nothing(network, make_case, sample_of):
    data = batches(network, make_case, sample_of, error=0.5)
    with torch.no_grad():
        before = network(data[0].sample)
    calibrate(network, data)
    again = calibrate(network, data)
    with torch.no_grad():
        after = network(data[0].sample)
    torch.testing.assert_close(after.part_log_modulus, before.part_log_modulus)
    torch.testing.assert_close(after.global_mean, before.global_mean)
    assert again.parts == pytest.approx(1.0, abs=1e-4)
    assert again.friction == pytest.approx(1.0, abs=1e-4)
    ratio = after.part_log_spread / before.part_log_spread
    assert float(ratio.mean()) == pytest.approx(0.5, rel=0.3)


def test_few_truths_change_nothing(network, make_case, sample_of):
    data = batches(network, make_case, sample_of, error=3.0, looks=LEAST // 2 - 1)
    assert calibrate(network, data).parts == 1.0
    assert float(network.part_scale) == 1.0
    assert calibrate(network, []).looks == 0.0


def test_truths_that_are_not_known_do_not_count(network, make_case, sample_of):
    data = batches(network, make_case, sample_of, error=2.0)
    unknown = torch.full_like(data[0].truth.globals, torch.nan)
    blind = [replace(batch, truth=replace(batch.truth, globals=unknown)) for batch in data]
    with torch.no_grad():
        assert bool(deviations(network(blind[0].sample), blind[0]).globals.isnan().all())
    assert calibrate(network, blind).friction == 1.0


def test_a_device_without_doubles_is_left_before_they_are_made(network, make_case, sample_of, monkeypatch):
    data, home, brought = batches(network, make_case, sample_of, error=2.0), torch.Tensor.cpu, []
    with monkeypatch.context() as patch:
        patch.setattr(torch.Tensor, "cpu", lambda self: brought.append(self.dtype) or home(self))
        calibrate(network, data)
    assert set(brought) == {torch.float32}


def test_looks_at_cases_whose_truth_nobody_knows_are_none(network, make_case, sample_of):
    case = replace(make_case(frames=4), truth=None)
    data = make_batch([Example(case, sample_of(case), true_values(case, 2))])
    found = calibrate(network, [data])
    assert (found.looks, found.parts, found.friction) == (0.0, 1.0, 1.0)


def test_what_is_no_number_is_not_calibrated(network, make_case, sample_of):
    data = batches(network, make_case, sample_of, error=2.0, looks=1)
    with torch.no_grad():
        for value in network.parameters():
            value.mul_(1e20)
    with pytest.raises(InputError, match="training diverged: what is predicted for log_modulus"):
        calibrate(network, data)
