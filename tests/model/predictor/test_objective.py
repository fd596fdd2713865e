"""The sum of the loss where network and simulator compute in different places."""

import pytest
import torch

from model.predictor.objective import LossWeights


def test_terms_of_rollouts_join_those_of_the_network_on_its_device():
    # "meta" stands for an accelerator: an operation that mixes it with the processor is an error there, too
    weights = LossWeights(track=2.0, prior=0.5)
    apart = {"prior": torch.ones((), device="meta"), "track": torch.ones(())}
    assert weights.total(apart).device.type == "meta"
    together = {"prior": torch.tensor(4.0), "track": torch.tensor(3.0, requires_grad=True)}
    total = weights.total(together)
    total.backward()
    assert float(total.detach()) == pytest.approx(8.0)
    assert float(together["track"].grad) == pytest.approx(2.0)
