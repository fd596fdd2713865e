"""Forces on small groups of points, against closed forms."""

import math

import pytest
import torch

from model.errors import InputError
from model.simulator.dynamics import Dynamics
from model.simulator.forces.bending import Bending
from model.simulator.forces.volume import Volume
from model.simulator.system import State, System


@pytest.fixture
def free_points():
    """Make a system of points that nothing joins, and a state of them."""

    def build(places):
        places = torch.tensor(places, dtype=torch.float64)
        nothing = torch.zeros((0, 2), dtype=torch.long)
        system = System(points=places, mass=1.0, springs=nothing, rest_length=torch.zeros(0))
        return system, State(places, torch.zeros_like(places))

    return build


@pytest.fixture
def energy_of():
    def energy(term, system, state):
        dynamics = Dynamics(system, [term], [])
        motion, values = dynamics.motion(state, None), dynamics.forces[0][1]
        return float(term.energy(motion, {**values, **term.rest_memory(motion, values)}).detach())

    return energy


@pytest.mark.parametrize("degrees", [20.0, 90.0, 150.0])
def test_a_row_that_turns_stores_the_energy_of_its_turn(free_points, energy_of, degrees):
    turn = math.radians(degrees)
    system, state = free_points([[-0.1, 0, 0], [0, 0, 0], [0.3 * math.cos(turn), 0.3 * math.sin(turn), 0]])
    row = torch.tensor([[0, 1, 2]])
    curved = 2 * math.tan(turn / 2)
    assert energy_of(Bending(row, 3.0, 0.4), system, state) == pytest.approx(3.0 * curved**2 / 0.4, rel=1e-9)
    assert energy_of(Bending(row, 3.0, 0.4, curved), system, state) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("apart", [0.0, 1e-7, 1e-4])
def test_a_row_that_is_folded_back_pushes_with_a_finite_force(apart, free_points, force_of):
    system, state = free_points([[0, 0, 0], [0.02, 0, 0], [0, apart, 0]])
    force = force_of(Bending(torch.tensor([[0, 1, 2]]), 1e-6, 0.04), system, state)
    assert torch.isfinite(force).all()


def test_a_straight_row_is_left_alone(free_points, force_of):
    system, state = free_points([[-0.1, 0, 0], [0, 0, 0], [0.3, 0, 0]])
    assert force_of(Bending(torch.tensor([[0, 1, 2]]), 3.0, 0.4), system, state).abs().max() < 1e-12


def test_a_tetrahedron_pushes_out_when_it_is_too_small(free_points, force_of, energy_of):
    system, state = free_points([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    term = Volume(torch.tensor([[0, 1, 2, 3]]), bulk_modulus=12.0, rest_volume=0.5)
    assert energy_of(term, system, state) == pytest.approx(6.0 * (1 / 6 - 0.5) ** 2 / 0.5)
    pressure = 12.0 * (0.5 - 1 / 6) / 0.5
    expected = pressure / 6 * torch.tensor([[-1.0, -1, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]]).double()
    torch.testing.assert_close(force_of(term, system, state), expected)


@pytest.mark.parametrize(
    "stencils", [torch.tensor([[0, 1]]), torch.tensor([0, 1, 2]), torch.tensor([[0, 1, 0]])]
)
def test_stencils_that_are_none_are_refused(stencils):
    with pytest.raises(InputError, match="stencils of bending"):
        Bending(stencils, 1.0, 1.0)
