import numpy as np
import pytest
import torch

from model.gap.bodies.body import body_of
from model.gap.erring_hand import ASIDE, EASED, ELSEWHERE, HAND, HOLD
from model.gap.plain import PlainTwin
from model.types import Observation


def moved(twin: PlainTwin, **values: float) -> np.ndarray:
    """Where the springs of the hands end in each frame [m]."""
    known = {name: torch.tensor(q.start).double() for name, q in twin.quantities.items()}
    known |= {name: torch.tensor(value).double() for name, value in values.items()}
    controls = twin.world(known, torch.float64).controls
    assert controls is not None
    return controls.numpy()


def test_a_hand_may_be_elsewhere_than_it_was_measured_to_be(chain):
    """From soon after the first frame on, all that it holds, and nothing that the other one does."""
    observation = chain(2)
    twin = PlainTwin.of(body_of(observation), observation)
    names = [name for name in twin.quantities if name.startswith(HAND)]
    assert names == [f"hand_{hand}_{axis}" for hand in (1, 2) for axis in "xyz"]
    assert all(twin.quantities[name].bounds == (-ELSEWHERE, ELSEWHERE) for name in names)
    away = moved(twin, hand_2_y=0.004) - moved(twin)
    late = observation.times >= EASED
    assert twin.matter.hold is not None
    second = twin.matter.hold.hands == 1
    assert 0 < second.sum() < len(second)
    np.testing.assert_allclose(
        away[late][:, second], np.broadcast_to([0, 0.004, 0], away[late][:, second].shape)
    )
    assert not away[:, ~second].any()
    assert not away[0].any()
    assert (np.diff(away[:, second, 1], axis=0) >= -1e-12).all()


def test_many_worlds_have_their_hands_each_elsewhere(chain):
    observation = chain(2)
    twin = PlainTwin.of(body_of(observation), observation)
    some = {name: [q.start, q.start] for name, q in twin.quantities.items()} | {"hand_1_x": [0.0, 0.003]}
    world = twin.world({name: torch.tensor(value).double()[:, None] for name, value in some.items()})
    assert world.controls is not None
    for each, value in enumerate(some["hand_1_x"]):
        np.testing.assert_allclose(world.controls[:, each], moved(twin, hand_1_x=value), atol=1e-6)


def firmness(twin: PlainTwin, **values: float | list[float]) -> np.ndarray:
    """Stiffness of the springs of the hands over that of the firmest [1]."""
    start = {name: quantity.start for name, quantity in twin.quantities.items()} | values
    many = [len(value) for value in start.values() if isinstance(value, list)]
    known = {name: torch.tensor(value).double() for name, value in start.items()}
    if many:
        known = {name: value.expand(many[0])[:, None] for name, value in known.items()}
    grip = twin.world(known, torch.float64).simulator.force("controller_spring")
    stiffness = grip.value("stiffness").detach()
    return (stiffness / stiffness.amax(-1, keepdim=True)).numpy()


def test_a_hand_may_hold_the_body_elsewhere_than_its_controllers_are(chain):
    """Farther along the rope, where it is firmest then; the other one holds as before."""
    observation = chain(2)
    twin = PlainTwin.of(body_of(observation), observation)
    names = [name for name in twin.quantities if name.startswith(HOLD)]
    assert names == [f"hold_{hand}_{axis}" for hand in (1, 2) for axis in "xyz"]
    aside = ASIDE * twin.body.grasp
    assert all(twin.quantities[name].bounds == (-aside, aside) for name in names)
    assert twin.matter.hold is not None
    first = twin.matter.hold.hands == 0
    along = twin.body.points[twin.body.grip[first, 1], 0]
    usual, other = firmness(twin), firmness(twin, hold_1_x=aside)
    assert along[usual[first].argmax()] == along.min()
    assert abs(along[other[first].argmax()] - along.min() - aside) <= 0.5 * twin.body.spacing
    np.testing.assert_array_equal(usual[~first], other[~first])
    np.testing.assert_allclose(firmness(twin, hold_1_x=[0.0, aside]), [usual, other], atol=1e-12)


def test_what_is_held_beside_its_middle_hangs_askew():
    """A plate that is held in the middle of an edge stays level; held to the right its left sinks."""
    side = np.linspace(0.0, 0.2, 9)
    places = np.stack(np.meshgrid(side, side, [1.0, 1.02], indexing="ij"), -1).reshape(-1, 3)
    hand = np.array([[0.09, 0.19, 1.01], [0.11, 0.19, 1.01], [0.1, 0.18, 1.01]])
    points, controllers = (np.repeat(one[None], 8, 0).astype(np.float32) for one in (places, hand))
    seen = Observation(np.arange(8) / 30, points, controllers)
    twin = PlainTwin.of(body_of(seen), seen)
    start = {name: torch.tensor(q.start).double() for name, q in twin.quantities.items()}
    left = twin.body.points[:, 0] < 0.05
    right = twin.body.points[:, 0] > 0.15

    def sunk(aside: float) -> float:
        """How much deeper the left is than the right, in the end [m]."""
        world = twin.world(start | {"hold_1_x": torch.tensor(aside).double()}, torch.float64)
        heights = world.rollout().points[-1, :, 2].numpy()
        return float(heights[right].mean() - heights[left].mean())

    assert abs(sunk(0.0)) < 0.1 * sunk(0.02)
    assert sunk(0.02) > 0.003
    assert sunk(-0.02) == pytest.approx(-sunk(0.02), rel=0.2)


def test_of_many_hands_none_is_taken_to_be_elsewhere(chain):
    observation = chain(3)
    twin = PlainTwin.of(body_of(observation), observation)
    assert not [name for name in twin.quantities if name.startswith((HAND, HOLD))]
    np.testing.assert_allclose(moved(twin)[0, :, 0], twin.controls[0, :, 0], atol=0.02)
