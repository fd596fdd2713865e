"""A hand through which something slides, against closed forms."""

import numpy as np
import pytest
import torch

from model.gap.effects.grip_slip import GripSlip, SlippingGrip, hands
from model.gap.sight import Sight
from model.gap.world import World
from model.simulator.build import build_simulator

LENGTH, SPEED = 0.1, 0.05
"""Of each spring [m], and of sliding for one weight more [m/s]."""


def bar(hand, other=None):
    """Five points in a row that hang from one hand or from two, of so many springs and so stiff [N/m]."""
    points = LENGTH * np.arange(5.0)[:, None] * [1.0, 0.0, 0.0] + [0.0, 0.0, 1.0]
    stiffness = np.concatenate([np.asarray(hand), [] if other is None else np.asarray(other)])
    held = [*range(len(hand)), *(() if other is None else range(5 - len(other), 5))]
    joined = np.array([(i, j) for i in range(5) for j in range(i + 1, 5) if j - i < 3])
    simulator = build_simulator(
        points=points,
        mass=np.full(5, 0.02),
        springs=joined,
        rest_length=np.linalg.norm(points[joined[:, 1]] - points[joined[:, 0]], axis=1),
        stiffness=2e3,
        controller_springs=np.stack([np.arange(len(held)), held], -1),
        controller_rest_length=np.zeros(len(held)),
        controller_stiffness=stiffness,
        controller_points=points[held],
        dashpot_damping=0.05,
        gravity=(9.81, 0.0, 0.0),
        dtype=torch.float64,
    )
    times = np.arange(31) / 30.0
    controls = torch.from_numpy(np.repeat(points[held][None], len(times), 0))
    sight = Sight(torch.arange(5)[:, None], torch.ones((5, 1), dtype=torch.float64))
    return World(simulator, sight, times, controls)


def slid(world, limit):
    """How fast it slides at last [m/s], and how far the farthest spring of the hand has by then [m]."""
    values = {"slip_speed": torch.tensor(SPEED), "load_limit": torch.tensor(limit)}
    with torch.no_grad():
        rollout = GripSlip().apply(world, values).rollout(substeps=400)
    x = rollout.points[..., 0].mean(-1)
    return float(x[-1] - x[-11]) * 3.0, float(rollout.end.memory["grip_slip.slip"].max())


@pytest.mark.parametrize("hand", [(400.0,), (100.0, 300.0), (20.0, 2000.0)])
@pytest.mark.parametrize("limit", [0.2, 0.7])
def test_the_heavier_it_is_the_faster_it_slides_however_stiff_the_hand(hand, limit):
    speed, _ = slid(bar(hand), limit)
    assert speed == pytest.approx(SPEED * (1.0 - limit), rel=0.03)


@pytest.mark.parametrize("limit", [0.2, 0.4])
def test_two_hands_hold_twice_as_much(limit):
    speed, _ = slid(bar((150.0, 250.0), (400.0,)), limit)
    assert speed == pytest.approx(SPEED * (0.5 - limit), rel=0.05)


def test_what_is_held_firmly_enough_does_not_slide():
    """Let go at once, it pulls with up to twice its weight."""
    assert slid(bar((400.0,)), 2.1)[1] == 0.0
    assert slid(bar((400.0,)), 1.5)[1] > 1e-4


def test_held_points_that_springs_join_are_of_one_hand():
    assert hands(bar((1.0, 1.0)).system).tolist() == [0, 0]
    assert hands(bar((1.0, 1.0), (1.0,)).system).tolist() == [0, 0, 1]


def test_what_was_pulled_out_is_pushed_back_by_as_much_force():
    def moved(length, slip):
        known = {"stiffness": 100.0, "slip_rate": 50.0, "holding_force": 0.2}
        told = {name: torch.tensor(value, dtype=torch.float64) for name, value in known.items()}
        zero, dt = torch.zeros((), dtype=torch.float64), torch.tensor(0.01, dtype=torch.float64)
        lost, slip = SlippingGrip.law(zero + length, zero, **told, slip=slip, dt=dt)
        return float(100.0 * length + lost), slip

    slip = torch.zeros((), dtype=torch.float64)
    for _ in range(60):
        tension, slip = moved(0.01, slip)
    assert tension == pytest.approx(0.2, rel=1e-6)
    assert float(slip) == pytest.approx(0.008)
    for _ in range(60):
        tension, slip = moved(0.001, slip)
    assert tension == pytest.approx(-0.2, rel=1e-6)
    assert float(slip) == pytest.approx(0.003)
