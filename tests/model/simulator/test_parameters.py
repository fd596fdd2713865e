import math

import numpy as np
import pytest
import torch

from model.errors import InputError
from model.simulator.forces.dashpot import Dashpot
from model.simulator.forces.gravity import Gravity
from model.simulator.forces.spring import Spring


def test_positive_constants_are_optimised_by_their_logarithm():
    spring = Spring(np.float32([2.0, 50.0]))
    (parameter,) = spring.parameters()
    assert parameter is spring.log_stiffness
    assert not parameter.requires_grad
    assert spring.value("stiffness").tolist() == pytest.approx([2.0, 50.0], rel=1e-15)
    assert parameter.tolist() == pytest.approx([math.log(2.0), math.log(50.0)], rel=1e-15)


def test_a_constant_with_gradients_stays_the_callers():
    leaf = torch.tensor([2.0, 3.0], requires_grad=True)
    spring = Spring(leaf * 2)
    assert list(spring.parameters()) == []
    (spring.value("stiffness") ** 2).sum().backward()
    assert leaf.grad.tolist() == [16.0, 24.0]
    owned = torch.nn.Parameter(torch.tensor([5.0]))
    assert Spring(owned).value("stiffness") is owned


def test_zero_is_a_positive_constant_that_stays_off():
    dashpot = Dashpot(0.0)
    dashpot.log_dashpot_damping.requires_grad_(True)
    value = dashpot.value("dashpot_damping")
    assert float(value.detach()) == 0.0
    value.backward()
    assert float(dashpot.log_dashpot_damping.grad) == 0.0


def test_numbers_keep_their_digits_in_float64_and_do_not_widen_float32():
    assert float(
        Dashpot(0.1).values(torch.zeros(1, dtype=torch.float64))["dashpot_damping"]
    ) == pytest.approx(0.1, rel=1e-15)
    assert Gravity().values(torch.zeros(1, dtype=torch.float32))["gravity"].dtype == torch.float32


@pytest.mark.parametrize(
    ("value", "what"), [(-1.0, "negative"), (float("nan"), "not finite"), (float("inf"), "not finite")]
)
def test_bad_values_are_refused(value, what):
    with pytest.raises(InputError, match=f"stiffness of Spring is {what}"):
        Spring(np.array([1.0, value]))


def test_other_values_make_another_term_and_leave_the_first():
    spring = Spring(np.float32([2.0, 50.0]))
    leaf = torch.tensor([3.0, 4.0], requires_grad=True)
    other = spring.with_values(stiffness=leaf)
    assert other.value("stiffness") is leaf
    assert list(other.parameters()) == []
    assert spring.value("stiffness").tolist() == pytest.approx([2.0, 50.0])
    back = other.with_values(stiffness=7.0)
    assert float(back.value("stiffness").detach()) == pytest.approx(7.0)
    assert [name for name, _ in back.named_parameters()] == ["log_stiffness"]
    with pytest.raises(InputError, match="Spring has no constant 'damping': it has stiffness"):
        spring.with_values(damping=1.0)
    with pytest.raises(InputError, match="negative"):
        spring.with_values(stiffness=-1.0)


def test_what_other_values_do_not_concern_is_the_very_same(system):
    other = system.with_values(mass=torch.tensor(3.0))
    assert other.edges is system.edges
    assert other.springs is system.springs
    assert other.log_rest_length is system.log_rest_length
