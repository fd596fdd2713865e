"""Self-collision in the kernel; where gradients flow, the oracle steps in for frames in which points meet."""

import numpy as np
import pytest
import torch

from model.simulator import backend
from model.simulator.build import build_simulator
from model.simulator.contacts.self_collision import SelfCollision
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


def test_where_gradients_flow_the_oracle_steps_in(frames_of_the_oracle):
    simulator, start = two_blocks(gap=0.05)
    start.velocities.requires_grad_()
    watched = simulator.rollout(start, frames=12, substeps=80)
    stepped_in = list(frames_of_the_oracle)
    truth = simulator.with_backend("torch").rollout(start, frames=12, substeps=80)
    torch.testing.assert_close(watched.points, truth.points, atol=2e-6, rtol=0)
    assert float(truth.velocities[-1, 8:, 0].detach().mean()) > 0.2  # they did meet
    assert 0 < len(stepped_in) < 11
    assert 1 not in stepped_in
    slopes = [torch.autograd.grad(r.points[-1].sum(), start.velocities)[0] for r in (watched, truth)]
    torch.testing.assert_close(*slopes, atol=1e-4, rtol=0)


def test_without_gradients_the_kernel_has_the_impact_of_the_oracle(frames_of_the_oracle):
    simulator, start = two_blocks(gap=0.05)
    watched = simulator.rollout(start, frames=12, substeps=80)
    assert not frames_of_the_oracle
    truth = simulator.with_backend("torch").rollout(start, frames=12, substeps=80)
    torch.testing.assert_close(watched.points, truth.points, atol=2e-6, rtol=0)
    assert float(truth.velocities[-1, 8:, 0].mean()) > 0.2


@pytest.fixture
def crumpled(rng):
    """A sheet in a heap on the ground, its points moving all ways; all masses differ."""
    side = 9
    flat = np.stack(np.meshgrid(*[np.arange(side)] * 2, indexing="ij"), -1).reshape(-1, 2) * 0.02
    rest = np.concatenate([flat, np.full((side * side, 1), 0.3)], 1)
    number = np.arange(side * side).reshape(side, side)
    springs = np.concatenate(
        [
            np.stack([a.ravel(), b.ravel()], 1)
            for a, b in ((number[1:], number[:-1]), (number[:, 1:], number[:, :-1]))
        ]
    )
    springs = springs[rng.permutation(len(springs))]

    def build(**options):
        return build_simulator(
            points=rest, mass=rng.uniform(0.001, 0.003, len(rest)), springs=springs, rest_length=0.02,
            stiffness=5.0, dashpot_damping=0.003, ground_height=0.0, dtype=torch.float64,
            **{"collision_distance": 0.018, "friction": 0.4, "restitution": 0.3, **options},
        )  # fmt: skip

    heap = torch.from_numpy(rng.uniform(0.0, 0.08, rest.shape))
    return build, State(heap, torch.from_numpy(rng.normal(0, 0.5, rest.shape)))


@pytest.mark.parametrize("threads", [1, 2])
def test_a_heap_is_that_of_the_oracle(crumpled, threads):
    build, heap = crumpled
    simulator = build()
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        found = simulator.rollout(heap, frames=4, fps=100.0, substeps=40)
    finally:
        torch.set_num_threads(before)
    truth = simulator.with_backend("torch").rollout(heap, frames=4, fps=100.0, substeps=40)
    contact = simulator.contact("self_collision")
    free = type(simulator)(
        simulator.system,
        [simulator.force(name) for name in simulator.forces],
        [simulator.contact("ground")],
    ).rollout(heap, frames=4, fps=100.0, substeps=40)
    assert (free.points[-1] - truth.points[-1]).norm(dim=-1).median() > 1e-3  # contacts everywhere
    assert contact.meets(truth.points[0], truth.points[-1])
    torch.testing.assert_close(found.points, truth.points, atol=1e-9, rtol=0)


def test_many_distances_at_once_are_as_one_by_one(crumpled):
    build, heap = crumpled
    made = build()
    distances = (0.0, 0.009, 0.018)
    together = torch.tensor([[distance] for distance in distances], dtype=torch.float64)
    rub = torch.tensor([[0.1], [0.2], [0.3]], dtype=torch.float64)
    options = {"frames": 4, "fps": 100.0, "substeps": 40}
    for backend_name in ("auto", "torch"):
        contact = SelfCollision(made.system, together, 0.3, rub)
        many = made.with_contact(contact).with_backend(backend_name).rollout(heap, **options)
        for number, distance in enumerate(distances):
            alone = SelfCollision(made.system, distance or 1e-9, 0.3, rub[number])
            one = made.with_contact(alone).with_backend(backend_name).rollout(heap, **options)
            torch.testing.assert_close(many.points[:, number], one.points, atol=1e-10, rtol=0)


def test_a_fast_passage_within_one_frame_is_seen():
    simulator, start = two_blocks(gap=0.01)
    contact = simulator.contact("self_collision")
    moved = start.positions.clone()
    moved[:8, 0] += 0.2  # through and beyond the other block
    assert contact.meets(start.positions, moved)
    assert not contact.meets(start.positions, start.positions)
    assert not contact.meets(start.positions, start.positions + 1.0)
