"""Self-collision beside the kernel: the oracle steps in for the frames in which points meet."""

import numpy as np
import pytest
import torch

from model.simulator import backend
from model.simulator.build import build_simulator
from model.simulator.system import State


def two_blocks(gap: float):
    """Two small blocks of points, joined inside, flying towards each other."""
    block = np.stack(np.meshgrid(*[np.arange(2)] * 3, indexing="ij"), -1).reshape(-1, 3) * 0.02
    points = np.concatenate([block, block + np.array([0.02 + gap, 0.0, 0.0])]).astype(np.float32)
    pairs = [(i, j) for side in (0, 8) for i in range(side, side + 8) for j in range(i + 1, side + 8)]
    springs = np.array(pairs, np.int32)
    rest = np.linalg.norm(points[springs[:, 0]] - points[springs[:, 1]], axis=1).astype(np.float32)
    simulator = build_simulator(
        points=points, mass=np.full(16, 0.002, np.float32), springs=springs, rest_length=rest,
        stiffness=np.full(len(springs), 40.0, np.float32), dashpot_damping=0.01, gravity=(0.0, 0.0, 0.0),
        collision_distance=0.008, restitution=0.5, friction=0.2,
    )  # fmt: skip
    velocities = np.zeros_like(points)
    velocities[:8, 0] = 0.5
    return simulator, State(torch.from_numpy(points), torch.from_numpy(velocities))


@pytest.fixture
def frames_of_the_oracle(monkeypatch):
    counted = []
    advance = backend.Oracle.advance

    def counting(self, *args):
        counted.append(args[1].frame)
        return advance(self, *args)

    monkeypatch.setattr(backend.Oracle, "advance", counting)
    return counted


def test_the_impact_is_that_of_the_oracle(frames_of_the_oracle):
    simulator, start = two_blocks(gap=0.05)
    watched = simulator.rollout(start, frames=12, substeps=80)
    stepped_in = list(frames_of_the_oracle)
    truth = simulator.with_backend("torch").rollout(start, frames=12, substeps=80)
    torch.testing.assert_close(watched.points, truth.points, atol=2e-6, rtol=0)
    assert float(truth.velocities[-1, 8:, 0].mean()) > 0.2  # they did meet
    assert 0 < len(stepped_in) < 11
    assert 1 not in stepped_in


def test_a_fast_passage_within_one_frame_is_seen():
    simulator, start = two_blocks(gap=0.01)
    contact = simulator.contact("self_collision")
    moved = start.positions.clone()
    moved[:8, 0] += 0.2  # through and beyond the other block
    assert contact.meets(start.positions, moved)
    assert not contact.meets(start.positions, start.positions)
    assert not contact.meets(start.positions, start.positions + 1.0)
