"""Air that meets the faces of a sheet: closed forms of its law, and what of a body it meets."""

import numpy as np
import pytest
import torch

from model.gap.effects import QuadraticAirDrag, SteadyWind
from model.gap.effects.air import met_by_air
from model.gap.effects.quadratic_air_drag import AirDragOnFaces
from model.gap.effects.wind import WindOnFaces
from model.gap.sight import Sight
from model.gap.world import World
from model.simulator.build import build_simulator

SPACING, MASS = 0.05, 0.002
TRIANGLE = np.array([[0.0, 0.0, 1.0], [0.1, 0.0, 1.0], [0.0, 0.1, 1.0]])


def vectors(rows):
    return tuple(tuple(torch.tensor(float(x), dtype=torch.float64) for x in row) for row in rows)


def number(value):
    return torch.tensor(value, dtype=torch.float64)


def dragged(velocity, facing, coefficient=2.0):
    """Force [N] on a level triangle that moves at a velocity [m/s]."""
    forces = AirDragOnFaces.law(
        vectors(TRIANGLE), vectors([velocity] * 3), number(coefficient), number(facing)
    )
    return np.array([[float(x) for x in force] for force in forces]).sum(0)


def net(axis: int = 2) -> World:
    """A net of 6 × 5 points in rows of triangles, its faces along an axis, nothing but air around it."""
    column, row = np.meshgrid(np.arange(6), np.arange(5), indexing="ij")
    flat = SPACING * np.stack([column + 0.5 * (row % 2), np.sqrt(0.75) * row, 0.0 * row], -1)
    points = np.roll(flat.reshape(-1, 3), axis + 1, axis=1)
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    springs = np.argwhere(np.triu(apart < 1.2 * SPACING, 1))
    simulator = build_simulator(
        points=points,
        mass=np.full(len(points), MASS),
        springs=springs,
        rest_length=apart[springs[:, 0], springs[:, 1]],
        stiffness=50.0,
        dashpot_damping=0.05,
        gravity=(0.0, 0.0, -9.81),
        dtype=torch.float64,
    )
    every = torch.arange(len(points))[:, None]
    sight = Sight(every, torch.ones(every.shape, dtype=torch.float64))
    return World(simulator, sight, np.arange(31) / 30.0)


def fallen(world: World) -> np.ndarray:
    """How far its middle has fallen by each frame [m]."""
    with torch.no_grad():
        heights = world.rollout(substeps=100).points[..., 2].mean(-1)
    return (heights[0] - heights).numpy()


@pytest.mark.parametrize(
    ("velocity", "facing", "expected"),
    [
        ((0.0, 0.0, 3.0), 1.0, (0.0, 0.0, -18.0)),
        ((0.0, 0.0, 3.0), 0.0, (0.0, 0.0, -18.0)),
        ((3.0, 0.0, 0.0), 1.0, (0.0, 0.0, 0.0)),
        ((3.0, 0.0, 0.0), 0.75, (-4.5, 0.0, 0.0)),
        ((3.0, 0.0, -4.0), 1.0, (0.0, 0.0, 40.0)),
        ((3.0, 0.0, -4.0), 0.0, (-30.0, 0.0, 40.0)),
    ],
)
def test_it_presses_along_the_normal_as_far_as_it_is_said_to(velocity, facing, expected):
    """c ‖v‖ v across the face, and of what is along it a share."""
    np.testing.assert_allclose(dragged(velocity, facing), expected, atol=1e-5)


def test_which_side_is_up_does_not_matter():
    flipped = TRIANGLE[[0, 2, 1]]
    velocities, constants = vectors([(0.3, -0.2, 1.0)] * 3), (number(2.0), number(0.9))
    first, second = (
        AirDragOnFaces.law(vectors(places), velocities, *constants) for places in (TRIANGLE, flipped)
    )
    np.testing.assert_allclose([float(x) for x in first[0]], [float(x) for x in second[0]])


def test_who_moves_with_the_wind_feels_none():
    """And who stands in it feels what who moves against still air does."""
    constants = (number(2.0), number(0.9))
    with_it = WindOnFaces.law(
        vectors(TRIANGLE), vectors([(1.0, 2.0, 0.5)] * 3), *constants, number(1.0), number(2.0), number(0.5)
    )
    np.testing.assert_allclose([float(x) for x in with_it[0]], 0.0, atol=1e-12)
    stands = WindOnFaces.law(
        vectors(TRIANGLE), vectors([(0.0, 0.0, 0.0)] * 3), *constants, number(1.0), number(2.0), number(0.5)
    )
    total = np.array([[float(x) for x in force] for force in stands]).sum(0)
    np.testing.assert_allclose(total, dragged((-1.0, -2.0, -0.5), 0.9))


def test_a_sheet_is_met_by_its_faces_with_all_of_its_mass():
    world = net()
    points, faces = met_by_air(world)
    assert len(points.stencils) == 0
    assert len(faces.stencils) == 2 * 5 * 4
    assert float(faces.mass.sum()) == pytest.approx(30 * MASS)


def test_of_half_a_sheet_half_the_mass_is_met():
    world = net()
    left = (world.system.points[:, 0] < 2.6 * SPACING).double()
    _, faces = met_by_air(world, left)
    assert float(faces.mass.sum()) == pytest.approx(float(left.sum()) * MASS)


def test_a_solid_is_met_by_its_points(block):
    points, faces = met_by_air(block)
    assert len(faces.stencils) == 0
    assert points.stencils[:, 0].tolist() == list(range(36))
    torch.testing.assert_close(points.mass, block.system.value("mass").expand(36).double())


def test_a_level_sheet_falls_as_fast_as_its_drag_allows():
    """To (g / c)^½; by the closed form v² / g ln cosh(g t / v)."""
    by = 4.0
    world = QuadraticAirDrag().apply(net(), {"drag_per_mass": number(by), "facing": number(1.0)})
    limit = np.sqrt(9.81 / by)
    expected = limit**2 / 9.81 * np.log(np.cosh(9.81 * world.times / limit))
    soon = slice(9)  # the net is as thin as can be, and begins to flutter
    np.testing.assert_allclose(fallen(world)[soon], expected[soon], rtol=0.02)
    assert fallen(world)[8] < 0.85 * fallen(net())[8]


def test_an_upright_sheet_falls_freely():
    """Edge on there is nothing to press upon; where air rubs alike from all sides there is."""
    world, free = net(axis=0), net(axis=0)
    edge_on = QuadraticAirDrag().apply(world, {"drag_per_mass": number(4.0), "facing": number(1.0)})
    np.testing.assert_allclose(fallen(edge_on), fallen(free), rtol=1e-6, atol=1e-9)
    rubbed = QuadraticAirDrag().apply(world, {"drag_per_mass": number(4.0), "facing": number(0.0)})
    assert fallen(rubbed)[-1] < 0.5 * fallen(free)[-1]


@pytest.mark.parametrize("effect", [QuadraticAirDrag(), SteadyWind()], ids=lambda effect: effect.name)
def test_gradients_reach_how_much_it_faces(effect):
    world = net(axis=1)
    start = {name: number(quantity.start) for name, quantity in effect.quantities.items()}
    start["drag_per_mass"] = number(5.0)

    def loss(facing):
        points = effect.apply(world, {**start, "facing": facing}).rollout(last=8, substeps=60).points
        weights = torch.linspace(1.0, 2.0, points.numel(), dtype=points.dtype).reshape(points.shape)
        return (weights * points).square().sum()

    facing = number(0.6).requires_grad_()
    loss(facing).backward()
    with torch.no_grad():
        slope = float(loss(number(0.6 + 1e-5)) - loss(number(0.6 - 1e-5))) / 2e-5
    assert slope != 0
    assert float(facing.grad) == pytest.approx(slope, rel=1e-4)
