import pytest
import torch

from model.errors import InputError
from model.simulator.contacts.self_collision import SelfCollision
from model.simulator.simulator import Simulator
from model.simulator.system import State, System


def loose(points, mass):
    """Points that nothing joins, at rest far from each other."""
    rest = torch.arange(len(mass), dtype=torch.float64)[:, None] * 10 + torch.zeros(3, dtype=torch.float64)
    system = System(
        points=rest,
        mass=torch.tensor(mass),
        springs=torch.zeros((0, 2), dtype=torch.long),
        rest_length=torch.zeros(0),
    )
    return system, torch.tensor(points, dtype=torch.float64)


def test_two_points_meet_head_on_and_rub():
    system, places = loose([[0.0, 0, 0], [0.01, 0, 0]], [1.0, 3.0])
    speeds = torch.tensor([[1.0, 0, 0], [-1.0, 2.0, 0]], dtype=torch.float64)
    term = SelfCollision(system, 0.02, 0.5, 0.25)
    after = term.resolve(places, speeds, torch.tensor([[1.0], [3.0]]), 1e-3, term.values(places))
    relative = after[1] - after[0]
    # normal -2 -> +1; tangential 2 - 0.25 * 1.5 * 2 = 1.25
    assert relative.tolist() == pytest.approx([1.0, 1.25, 0.0])
    assert (after[0] + 3 * after[1]).tolist() == pytest.approx([-2.0, 6.0, 0.0])


def test_many_contacts_at_once_do_not_add_energy():
    system, places = loose(
        [[0.0, 0, 0]] + [[0.01 * x, 0.01 * y, 0] for x, y in ((1, 0), (0, 1), (-1, 0), (0, -1))], [1.0] * 5
    )
    speeds = -5.0 * places / 0.01  # four points run into the one in the middle
    term = SelfCollision(system, 0.0105, 1.0, 0.0)
    after = term.resolve(places, speeds, torch.ones(5, 1), 1e-3, term.values(places))
    assert (after**2).sum() <= (speeds**2).sum() * (1 + 1e-12)
    assert after.sum(0).abs().max() < 1e-12
    assert not torch.equal(after, speeds)


def test_a_chain_does_not_pass_through_itself():
    """Two loose beads shot at each other bounce at the collision distance instead of passing."""
    system, places = loose([[0.0, 0, 0], [1.0, 0, 0]], [1.0, 1.0])
    state = State(places, torch.tensor([[1.0, 0, 0], [-1.0, 0, 0]], dtype=torch.float64))
    rollout = Simulator(system, [], [SelfCollision(system, 0.05, 1.0, 0.0)]).rollout(
        state, frames=11, fps=10.0, substeps=50
    )
    gap = rollout.points[:, 1, 0] - rollout.points[:, 0, 0]
    step = 2.0 / 10 / 50
    assert gap.min() > 0.05 - 2 * step
    # met after 0.475 s at a gap of 0.05, apart for 0.525 s; met a step late costs the way of two steps
    assert abs(float(gap[-1]) - (0.05 + 2 * 0.525)) < 2.01 * step


def test_bad_distance():
    system, _ = loose([[0.0, 0, 0]], [1.0])
    with pytest.raises(InputError, match="collision_distance is -1"):
        SelfCollision(system, -1.0, 0.5, 0.5)
