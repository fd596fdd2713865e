import pytest
import torch

from model.predictor.limits import soft_limit


def test_small_values_pass_and_large_ones_stay_in_reach():
    values = torch.tensor([0.0, 1e-3, -1e-3, 3.0, 1e5, -1e5], dtype=torch.float64)
    found = soft_limit(values, 3.0)
    torch.testing.assert_close(found[:3], values[:3], rtol=1e-3, atol=0.0)
    assert found[3] == pytest.approx(1.5)  # half way at the limit itself
    assert (found.abs() < 3.0).all()
    assert found[4] > 2.999
    assert found[5] < -2.999


@pytest.mark.parametrize("value", [0.0, 1.0, -30.0, 300.0])
def test_the_slope_dies_slowly(value):
    x = torch.tensor(value, dtype=torch.float64, requires_grad=True)
    soft_limit(x, 3.0).backward()
    assert float(x.grad) == pytest.approx((1.0 + abs(value) / 3.0) ** -2)
    assert float(x.grad) > 5e-5  # a tanh's would be e⁻²⁰⁰ at 300


def test_limits_may_differ_by_element():
    values, limits = torch.full((3,), 1e6), torch.tensor([1.0, 2.0, 4.0])
    torch.testing.assert_close(soft_limit(values, limits), limits, rtol=1e-5, atol=0.0)


def test_its_gradient_is_its_derivative():
    values = torch.tensor([-2.0, -0.3, 0.4, 5.0], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda x: soft_limit(x, 1.7), values)
