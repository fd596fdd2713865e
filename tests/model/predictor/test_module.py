import pytest
import torch

from model.predictor.batches import Example, make_batch, true_values
from model.predictor.module import PredictorModule, Rollouts
from model.predictor.objective import LossWeights, belief_terms, motion_terms
from model.predictor.options import NetworkOptions


def test_the_horizon_grows_from_the_end_of_the_warm_up_on():
    rollouts = Rollouts(warm_up=3, first_horizon=6, last_horizon=20)
    found = [rollouts.horizon(epoch, 10) for epoch in range(10)]
    assert found[:3] == [0, 0, 0]
    assert (found[3], found[-1]) == (6, 20)
    assert found[3:] == sorted(found[3:])
    assert Rollouts(warm_up=0, per_batch=0).horizon(5, 10) == 0
    assert Rollouts(warm_up=9).horizon(9, 10) == 8


@pytest.fixture
def batch(make_case, sample_of):
    cases = [make_case(seed=seed, frames=8) for seed in range(2)]
    return make_batch([Example(case, sample_of(case), true_values(case, 2)) for case in cases])


def test_the_whole_loss_moves_every_weight(batch):
    """Gradients of the loss that is minimised, rollouts included, for every parameter of the network."""
    torch.manual_seed(0)
    module = PredictorModule(5, 3, NetworkOptions(dim=16, layers=1, heads=2, dropout=0.0))
    prediction = module(batch)
    terms, diverged = motion_terms(prediction, batch, [0, 1], horizon=5)
    assert diverged == 0
    module.weights.total(belief_terms(prediction, batch) | terms).backward()
    for name, value in module.network.named_parameters():
        assert value.grad is not None, name
        assert bool(torch.isfinite(value.grad).all()), name
        assert float(value.grad.abs().max()) > 0.0, name


def test_rollouts_alone_teach_the_grip(batch):
    """What no truth is known of is learned from motion."""
    torch.manual_seed(0)
    module = PredictorModule(5, 3, NetworkOptions(dim=16, layers=1, heads=2, dropout=0.0))
    prediction = module(batch)
    belief = module.weights.total(belief_terms(prediction, batch))
    heads = list(module.network.grip_decoder.parameters())
    before = torch.autograd.grad(belief, heads, retain_graph=True, allow_unused=True)
    assert all(value is None or float(value.abs().max()) == 0.0 for value in before)
    terms, _ = motion_terms(prediction, batch, [0, 1], horizon=8)
    after = torch.autograd.grad(LossWeights().total(terms), heads)
    assert max(float(value.abs().max()) for value in after) > 0.0


def test_learning_from_truth_brings_predictions_to_it(batch):
    torch.manual_seed(0)
    module = PredictorModule(5, 3, NetworkOptions(dim=16, layers=1, heads=2, dropout=0.0))
    optimiser = torch.optim.AdamW(module.network.parameters(), lr=1e-2)
    losses, errors = [], []
    for _ in range(40):
        optimiser.zero_grad()
        prediction = module(batch)
        loss = module.weights.total(belief_terms(prediction, batch))
        loss.backward()
        optimiser.step()
        losses.append(float(loss.detach()))
        errors.append(
            float((prediction.part_log_modulus - batch.truth.part_log_modulus).abs().mean().detach())
        )
    assert losses[-1] < losses[0] - 0.5
    assert errors[-1] < 0.3 * errors[0]
