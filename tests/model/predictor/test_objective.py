"""The sum of the loss where network and simulator compute in different places."""

import numpy as np
import pytest
import torch

from model.predictor import objective
from model.predictor.objective import LossWeights, judge_motion
from model.predictor.rollout import Mechanics
from model.simulator.divergence import SimulationDiverged


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


def test_a_rollout_that_flies_off_is_judged_as_one_that_diverged(make_case, monkeypatch):
    case = make_case(frames=9)

    def flying(case, mechanics, frames=None, checkpoint=True):
        moved = torch.as_tensor(case.rest).expand(len(case.observation.times), -1, -1).clone()
        moved[5:, 0] += 1e7
        return moved

    def diverging(case, mechanics, frames=None, checkpoint=True):
        raise SimulationDiverged(5, 0, "spring", 10)

    one = torch.ones(())
    springs, grips = (torch.ones(len(of)) for of in (case.topology.springs, case.topology.controller_springs))
    mechanics, found = Mechanics(springs, grips, one, one, one, one), []
    for rolled in (flying, diverging):
        monkeypatch.setattr(objective, "roll_out", rolled)
        found.append(judge_motion(case, mechanics))
    assert found[0].diverged
    assert found[0] == found[1]
    assert np.isfinite(found[0].future)
