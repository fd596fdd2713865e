"""Forces on small groups of points, against closed forms."""

import math
from dataclasses import replace

import pytest
import torch
from scipy.spatial.transform import Rotation

from model.errors import InputError
from model.simulator.dynamics import Dynamics
from model.simulator.forces.bending import Bending
from model.simulator.forces.curved_bending import CurvedBending
from model.simulator.forces.volume import Volume
from model.simulator.system import State, System


@pytest.fixture
def free_points():
    """Make a system of points that nothing joins, and a state of them."""

    def build(places, dtype=torch.float64):
        places = torch.as_tensor(places, dtype=dtype)
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


both_bend = pytest.mark.parametrize("kind", [Bending, CurvedBending], ids=lambda kind: kind.name)


@both_bend
@pytest.mark.parametrize("degrees", [20.0, 90.0, 150.0])
def test_a_row_that_turns_stores_the_energy_of_its_turn(free_points, energy_of, degrees, kind):
    turn = math.radians(degrees)
    system, state = free_points([[-0.1, 0, 0], [0, 0, 0], [0.3 * math.cos(turn), 0.3 * math.sin(turn), 0]])
    row = torch.tensor([[0, 1, 2]])
    curved = 2 * math.tan(turn / 2)
    assert energy_of(kind(row, 3.0, 0.4), system, state) == pytest.approx(3.0 * curved**2 / 0.4, rel=1e-9)
    assert energy_of(kind(row, 3.0, 0.4, curved), system, state) == pytest.approx(0.0, abs=1e-15)


@both_bend
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("curved", [0.0, 0.3])
@pytest.mark.parametrize("apart", [0.0, 1e-7, 1e-4])
def test_a_row_that_is_folded_back_pushes_with_a_finite_force(apart, curved, dtype, kind, free_points):
    system, state = free_points([[0, 0, 0], [0.02, 0, 0], [0, apart, 0]], dtype)
    dynamics = Dynamics(system, [kind(torch.tensor([[0, 1, 2]]), 1e-6, 0.04, curved)], [])
    remembering = replace(state, memory=dynamics.rest_memory(state, None))
    for _ in range(2):
        acceleration, memory = dynamics.acceleration(remembering, None, 1e-3)
        assert torch.isfinite(acceleration).all()
        assert all(torch.isfinite(value).all() for value in memory.values())
        remembering = replace(state, memory=memory)


def led(term, free_points, places):
    """What it remembers after its points were led through places [m], by name."""
    memory = {}
    for place in places:
        system, state = free_points(place)
        dynamics = Dynamics(system, [term], [])
        state = replace(state, memory={**dynamics.rest_memory(state, None), **memory})
        _, memory = dynamics.acceleration(state, None, 1e-3)
    return {name.split(".")[1]: value for name, value in memory.items()}


@pytest.mark.parametrize("step", [0.005, 0.5], ids=["slowly", "at once"])
def test_a_turn_at_rest_stays_as_large_as_it_is_however_it_is_turned(step, free_points):
    """Once around an axis across the chord it is what it was."""
    place = torch.tensor([[-0.02, 0, 0], [0, 0.005, 0], [0.02, 0, 0]], dtype=torch.float64)
    axis = torch.tensor([0.0, 0.6, 0.8], dtype=torch.float64)
    angles = torch.linspace(0.0, 6.0 * math.pi, round(6.0 * math.pi / step) + 1)
    turned = [place @ torch.from_numpy(Rotation.from_rotvec(float(by) * axis).as_matrix()).T for by in angles]
    term = CurvedBending(torch.tensor([[0, 1, 2]]), 1e-6, 0.04, 0.3)
    first, last = (led(term, free_points, one) for one in (turned[:1], turned))
    for name, value in first.items():
        assert float(last[name]) == pytest.approx(float(value), abs=1e-6), name


def test_a_chord_that_was_short_does_not_make_a_turn_larger(free_points):
    short = [[-5e-5, 0, 0], [0, 1e-2, 0], [5e-5, 0, 0]]
    wide = [[-2e-4, 0, 1e-4], [0, 1e-2, 0], [3e-4, 0, 0]]
    term = CurvedBending(torch.tensor([[0, 1, 2]]), 1e-6, 0.04, 0.3)
    memory = led(term, free_points, [short, wide])
    size = math.sqrt(sum(float(memory[f"rest_{axis}"]) ** 2 for axis in "xyz"))
    assert size == pytest.approx(0.3, rel=1e-6)


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
