import math

import pytest
import torch

from model.evaluation.baselines.gradient import Free, descend
from model.simulator.divergence import SimulationDiverged


def test_it_descends_to_the_bottom_and_stays_within_bounds():
    x, y = torch.tensor([3.0], requires_grad=True), torch.tensor([3.0], requires_grad=True)
    least = descend(
        lambda: ((x - 1.0) ** 2 + (y - 1.0) ** 2).sum(), [Free([x], 0.1), Free([y], 0.1, low=2.0)], 200
    )
    assert x.item() == pytest.approx(1.0, abs=0.01)
    assert y.item() == 2.0
    assert least == pytest.approx(1.0, abs=0.01)


def test_a_step_that_diverges_is_taken_back():
    x = torch.tensor([3.0], requires_grad=True)

    def loss() -> torch.Tensor:
        if x.item() < 1.0:
            raise SimulationDiverged(3, 0, "spring", 10)
        return x.sum()

    least = descend(loss, [Free([x], 0.7)], 30)
    assert 1.0 <= x.item() == least < 2.0


def test_a_start_that_diverges_is_told():
    x = torch.tensor([3.0], requires_grad=True)

    def loss() -> torch.Tensor:
        raise SimulationDiverged(1, 0, "spring", 10)

    with pytest.raises(SimulationDiverged, match="in frame 1"):
        descend(loss, [Free([x], 0.1)], 3)


def test_the_best_place_is_kept_not_the_last():
    x = torch.tensor([0.3], requires_grad=True)
    least = descend(lambda: x.abs().sum(), [Free([x], 0.5)], 7)
    assert x.abs().item() == pytest.approx(least)
    assert least <= 0.3
    assert math.isfinite(least)
