import numpy as np
import pytest
import torch

from model.evaluation.baselines.hold_last import HoldLast
from model.evaluation.baselines.nearest_anchors import NearestAnchors, Neighbours


@pytest.fixture(scope="module")
def case(make_case):
    return make_case(frames=14)


@pytest.fixture(scope="module")
def fitted(case, hide):
    return NearestAnchors(neighbours=12, starts=5, steps=15).fit(hide(case))


def test_a_spring_has_what_its_ends_give(case):
    topology = case.topology
    made = Neighbours(topology, 8)
    soft = made.stiffness(torch.ones(len(topology.points)), torch.tensor(0.0))
    hard = made.stiffness(torch.ones(len(topology.points)), torch.tensor(-30.0))
    lengths = torch.as_tensor(made.topology.rest_length)
    both = hard * lengths
    assert torch.isin(both.round(decimals=3), torch.tensor([0.5, 1.0])).all()
    listed = np.bincount(made.topology.springs.ravel(), minlength=len(topology.points))
    assert listed.min() >= 8
    assert (soft <= hard + 1e-6).all()
    assert float(soft.sum()) < 0.9 * float(hard.sum())


def test_gradients_reach_every_point_and_the_fading(case):
    made = Neighbours(case.topology, 8)
    point = torch.ones(len(case.topology.points), requires_grad=True)
    softness = torch.zeros((), requires_grad=True)
    made.stiffness(point, softness).sum().backward()
    assert (point.grad > 0).all()
    assert softness.grad < 0


def test_it_fits_what_it_sees(case, hide, errors, fitted):
    rough = NearestAnchors(neighbours=12, starts=5, steps=0).fit(hide(case))
    assert errors(case, fitted)[0] < 0.7 * errors(case, rough)[0]
    assert errors(case, fitted)[0] < 0.1 * errors(case, HoldLast().fit(hide(case)))[0]


def test_it_tells_the_softer_part_and_is_the_same_again(case, hide, fitted):
    soft, stiff = fitted.part_belief.log_modulus
    assert stiff > soft + 0.1
    again = NearestAnchors(neighbours=12, starts=5, steps=15).fit(hide(case))
    assert np.array_equal(again.stiffness, fitted.stiffness)


def test_another_interaction_is_replayed_with_the_springs_found(make_case, hide, errors, fitted):
    other = make_case(frames=10, lift=0.1, name="other")
    assert errors(other, fitted)[0] < 0.3 * errors(other, HoldLast().fit(hide(other)))[0]
