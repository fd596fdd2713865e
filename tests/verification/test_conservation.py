"""What a closed system keeps, what no frame of reference changes, and the order of the integrators."""

import math
from itertools import pairwise

import pytest
import torch
from scipy.spatial.transform import Rotation

from model.simulator.contacts.ground import Ground
from model.simulator.contacts.self_collision import SelfCollision
from model.simulator.dynamics import Dynamics
from model.simulator.forces.dashpot import Dashpot
from model.simulator.forces.drag import Drag
from model.simulator.forces.gravity import Gravity
from model.simulator.forces.spring import Spring
from model.simulator.forces.unprojected_dashpot import UnprojectedDashpot
from model.simulator.integrators import ALL_INTEGRATORS
from model.simulator.simulator import Simulator
from model.simulator.system import State

every_integrator = pytest.mark.parametrize("kind", ALL_INTEGRATORS, ids=lambda kind: kind.name)


@pytest.fixture
def excited(blob):
    """Stretched, spinning and flying."""
    axis = torch.tensor([1.0, 2.0, -0.5], dtype=torch.float64)
    spin = torch.linalg.cross(axis.expand_as(blob.points), blob.points)
    return State(1.2 * blob.points, spin + torch.tensor([0.5, -0.2, 0.1], dtype=torch.float64))


def momenta(system, rollout):
    mass = system.value("mass")[:, None]
    linear = (mass * rollout.velocities).sum(1)
    angular = torch.linalg.cross(rollout.points, mass * rollout.velocities).sum(1)
    return linear, angular


@every_integrator
def test_internal_forces_keep_both_momenta(kind, blob, excited):
    simulator = Simulator(blob, [Spring(200.0), Dashpot(1.0)], integrator=kind())
    linear, angular = momenta(blob, simulator.rollout(excited, frames=11, fps=50.0, substeps=20))
    torch.testing.assert_close(linear, linear[:1].expand_as(linear), rtol=1e-12, atol=1e-12)
    torch.testing.assert_close(angular, angular[:1].expand_as(angular), rtol=1e-12, atol=1e-12)


def test_the_projected_dashpot_lets_a_rigid_body_spin(blob):
    """Of a slow rotation it takes next to nothing; the printed one takes most of it."""
    axis = torch.tensor([0.0, 0.0, 0.1], dtype=torch.float64)
    spin = State(
        blob.points, torch.linalg.cross(axis.expand_as(blob.points), blob.points - blob.points.mean(0))
    )
    kept = []
    for damper in (Dashpot(1.0), UnprojectedDashpot(1.0)):
        rollout = Simulator(blob, [Spring(200.0), damper]).rollout(spin, frames=2, fps=2.0, substeps=100)
        _, angular = momenta(blob, rollout)
        kept.append(float(angular[1].norm() / angular[0].norm()))
    assert kept[0] == pytest.approx(1.0, abs=1e-12)
    assert kept[1] < 0.2


def test_self_collision_keeps_momentum(pair, meeting):
    forces, contact = [Spring(200.0), Dashpot(0.5)], SelfCollision(pair, 0.06, 0.5, 0.3)
    apart, met = (
        Simulator(pair, forces, contacts).rollout(meeting, frames=9, fps=100.0, substeps=5)
        for contacts in ([], [contact])
    )
    assert (met.points[-1] - apart.points[-1]).norm() > 0.05  # they did meet
    linear, _ = momenta(pair, met)
    torch.testing.assert_close(linear, linear[:1].expand_as(linear), rtol=1e-12, atol=1e-12)


@every_integrator
def test_energy_errs_with_the_declared_order_and_does_not_drift(kind, blob, excited):
    """The error of a symplectic method stays what it is in the first swings."""
    simulator = Simulator(blob, [Spring(200.0)], integrator=kind())
    dynamics = Dynamics(blob, [simulator.force("spring")], [])
    ((term, values),) = dynamics.forces
    mass, worst = blob.value("mass")[:, None], []
    for substeps in (8, 16):
        rollout = simulator.rollout(excited, frames=31, fps=50.0, substeps=substeps)
        total = torch.stack([
            (mass * speed**2).sum() / 2 + term.energy(dynamics.motion(State(place, speed), None), values)
            for place, speed in zip(rollout.points, rollout.velocities, strict=True)
        ])  # fmt: skip
        error = (total / total[0] - 1).abs()
        worst.append(float(error.max()))
        assert float(error[20:].max()) < 1.2 * float(error[:11].max())
    assert math.log2(worst[0] / worst[1]) == pytest.approx(kind.order, abs=0.1)


@every_integrator
def test_converges_with_the_declared_order(kind, blob, excited):
    forces = [Spring(200.0), Dashpot(0.5), Gravity(), Drag(0.7)]
    simulator = Simulator(blob, forces, integrator=kind())
    ends = [
        simulator.rollout(excited, frames=2, fps=10.0, substeps=40 * 2**number).end.positions
        for number in range(3)
    ]
    steps = [float((fine - coarse).norm()) for coarse, fine in pairwise(ends)]
    assert math.log2(steps[-2] / steps[-1]) == pytest.approx(kind.order, abs=0.1)


@pytest.mark.parametrize("ground", [False, True], ids=["space", "ground"])
def test_a_rollout_turns_with_the_world(pair, meeting, ground):
    """Any rotation without ground, one about the vertical with it; two bodies collide on the way."""
    turn = torch.from_numpy(Rotation.from_rotvec([0, 0, 1.1] if ground else [0.4, -1.1, 0.7]).as_matrix())
    weight = torch.tensor([0.0, 0.0, -9.81] if ground else [0.5, 1.0, -9.0], dtype=torch.float64)
    plane = [Ground(0.3, 0.4, 0.02)] if ground else []
    same = torch.eye(3, dtype=torch.float64)
    ends = []
    for rotation, contacts in (
        (same, [SelfCollision(pair, 0.06, 0.2, 0.3), *plane]),
        (turn, [SelfCollision(pair, 0.06, 0.2, 0.3), *plane]),
        (same, plane),
        (same, []),
    ):
        forces = [Spring(200.0), Dashpot(0.5), Drag(0.7), Gravity(rotation @ weight)]
        start = State(meeting.positions @ rotation.T, meeting.velocities @ rotation.T)
        rollout = Simulator(pair, forces, contacts).rollout(start, frames=9, fps=100.0, substeps=5)
        ends.append(rollout.points[-1] @ rotation)
    torch.testing.assert_close(ends[0], ends[1], rtol=0, atol=1e-12)
    assert (ends[0] - ends[2]).norm() > 0.05  # the bodies did meet
    assert ((ends[2] - ends[3]).norm() > 0.01) == ground  # and the ground
