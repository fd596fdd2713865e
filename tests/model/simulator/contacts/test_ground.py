import pytest
import torch

from model.simulator.contacts.ground import Ground


def after(position, velocity, restitution=0.5, friction=0.3, height=0.1, dt=1e-3):
    ground = Ground(restitution, friction, height)
    place, speed = (torch.tensor([value], dtype=torch.float64) for value in (position, velocity))
    return ground.resolve(place, speed, torch.ones(1, 1), dt, ground.values(place))[0].tolist()


def test_impact_and_sliding_friction():
    # normal: 2 -> 0.5 * 2; tangential 3 -> 3 - 0.3 * 1.5 * 2 = 2.1, in the direction (0.6, 0.8)
    assert after([0, 0, 0.1005], [1.8, 2.4, -2.0]) == pytest.approx([1.26, 1.68, 1.0])


def test_friction_never_reverses():
    assert after([0, 0, 0.1], [0.3, -0.4, -2.0]) == pytest.approx([0.0, 0.0, 1.0])


def test_straight_impact_has_no_direction_to_rub():
    assert after([0, 0, 0.1], [0.0, 0.0, -2.0]) == pytest.approx([0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("position", "velocity"),
    [([0, 0, 0.2], [1.0, 0.0, -2.0]), ([0, 0, 0.05], [1.0, 0.0, 0.1]), ([0, 0, 0.1021], [1.0, 0.0, -2.0])],
    ids=["far above", "below and rising", "not reached in this step"],
)
def test_no_contact(position, velocity):
    assert after(position, velocity) == velocity


def test_below_and_sinking_is_stopped():
    assert after([0, 0, -1.0], [0.0, 0.0, -2.0], restitution=0.0) == pytest.approx([0.0, 0.0, 0.0])
