"""Friction and restitution on the ground."""

import math

import pytest
import torch

from model.simulator.contacts.ground import Ground
from model.simulator.forces.gravity import Gravity
from model.simulator.simulator import Simulator

ANGLE = math.radians(25)
SLOPE = (9.81 * math.sin(ANGLE), 0.0, -9.81 * math.cos(ANGLE))
"""Gravity as a plane inclined by 25° feels it."""


def slide(points, friction):
    block = Simulator(points([[0.0, 0, 0]]), [Gravity(SLOPE)], [Ground(0.0, friction)])
    return block.rollout(frames=2, fps=1.0, substeps=400).end


def test_block_slips(points):
    """a = g (sin θ - μ cos θ); x_n = a dt² n(n+1)/2 exactly."""
    friction, dt = 0.3, 1 / 400
    end = slide(points, friction)
    pull = 9.81 * (math.sin(ANGLE) - friction * math.cos(ANGLE))
    assert float(end.velocities[0, 0]) == pytest.approx(pull, rel=1e-12)
    assert float(end.positions[0, 0]) == pytest.approx(pull * dt**2 * 400 * 401 / 2, rel=1e-12)
    assert float(end.positions[0, 2]) == 0.0


def test_block_sticks(points):
    """Friction above tan θ holds it where it is."""
    assert slide(points, 1.01 * math.tan(ANGLE)).positions.abs().max() == 0.0
    assert slide(points, 0.99 * math.tan(ANGLE)).positions[0, 0] > 1e-3


@pytest.mark.parametrize("restitution", [0.0, 0.3, 0.8])
def test_bounce_height(points, restitution):
    """It rises to e² of the height it fell from; speed and height at impact err by at most a step's."""
    drop, substeps = 0.5, 100
    simulator = Simulator(points([[0.0, 0, drop]]), [Gravity()], [Ground(restitution, 0.4)])
    impact = math.sqrt(2 * drop / 9.81)
    frames = math.ceil((impact * (1 + restitution) + 0.02) * 100)
    rollout = simulator.rollout(frames=frames, fps=100.0, substeps=substeps)
    dt, speed = 1 / 100 / substeps, 9.81 * impact
    after = rollout.points[math.ceil(impact * 100) + 1 :, 0, 2]
    # v errs by g dt, so the height by e² v dt; the bounce begins up to v dt above the plane; a frame is 10 ms
    between_frames = 9.81 * (1 / 200) ** 2 / 2
    tolerance = 2 * speed * dt + between_frames
    assert float(after.max()) == pytest.approx(restitution**2 * drop, abs=tolerance)
    assert float(rollout.points[..., 2].min()) >= 0.0


def test_sliding_stops_where_it_should(points):
    """A block thrown along level ground comes to rest after v²/(2 μ g), within one step's way."""
    friction, speed, dt = 0.5, 1.0, 1e-3
    simulator = Simulator(points([[0.0, 0, 0]]), [Gravity()], [Ground(0.0, friction)])
    start = simulator.rest_state()
    start = type(start)(start.positions, torch.tensor([[0.6, 0.8, 0.0]], dtype=torch.float64) * speed)
    end = simulator.rollout(start, frames=2, fps=2.0, substeps=500).end
    assert end.velocities.norm() == 0.0
    way = speed**2 / (2 * friction * 9.81)
    assert float(end.positions.norm()) == pytest.approx(way, abs=speed * dt)
    assert float(end.positions[0, 1] / end.positions[0, 0]) == pytest.approx(0.8 / 0.6)
