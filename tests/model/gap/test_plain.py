from dataclasses import replace

import numpy as np
import pytest
import torch

from model.gap.bodies.body import body_of
from model.gap.plain import EASED, ELSEWHERE, HAND, PlainTwin
from model.simulator.structure import rows
from model.types import Observation


def markers(seed: int) -> Observation:
    """Six markers anywhere on something flat, one of which a hand holds and shakes."""
    rng = np.random.default_rng(seed)
    places = np.column_stack([*rng.uniform(0.0, 0.3, (2, 6)), 1.0 + rng.normal(0.0, 0.002, 6)])
    times = np.arange(30) / 30
    way = np.stack([0.1 * np.sin(3.0 * times), 0 * times, 0 * times], -1)[:, None]
    noise = rng.normal(0.0, 0.001, (30, 6, 3))
    points, hand = places + way + noise, places[:1] + way
    return Observation(times, points.astype(np.float32), hand.astype(np.float32))


def test_a_few_flat_markers_with_no_three_in_a_row_have_a_twin():
    seen = [markers(seed) for seed in range(8)]
    bodies = [body_of(one) for one in seen]
    without = [
        (body, one)
        for body, one in zip(bodies, seen, strict=True)
        if body.shape == "sheet" and not len(rows(body.points, body.springs))
    ]
    assert without, "some of them are such"
    for body, one in without:
        twin = PlainTwin.of(body, one)
        assert not {"bending", "bending_decay"} & set(twin.quantities)
        values = {name: torch.tensor(q.start).double() for name, q in twin.quantities.items()}
        made = twin.world(values).rollout(last=3)
        assert bool(torch.isfinite(made.points).all())
        assert made.points.shape[1] == pytest.approx(6, abs=1)


def chain(hands: int) -> Observation:
    """A rope that so many hands hold, of which the last is shaken."""
    times = np.arange(30) / 30
    places = np.column_stack([np.linspace(0.0, 0.6, 40), np.zeros(40), np.ones(40)])
    points = np.repeat(places[None], 30, 0)
    held = places[np.linspace(0, 39, hands).round().astype(int)]
    controllers = np.repeat(held[None], 30, 0)
    controllers[:, -1, 1] += 0.02 * np.sin(9.0 * times)
    return Observation(times, points.astype(np.float32), controllers.astype(np.float32))


def moved(twin: PlainTwin, **values: float) -> np.ndarray:
    """Where the springs of the hands end in each frame [m]."""
    known = {name: torch.tensor(q.start).double() for name, q in twin.quantities.items()}
    known |= {name: torch.tensor(value).double() for name, value in values.items()}
    controls = twin.world(known, torch.float64).controls
    assert controls is not None
    return controls.numpy()


def test_a_hand_may_be_elsewhere_than_it_was_measured_to_be():
    """From soon after the first frame on, all that it holds, and nothing that the other one does."""
    observation = chain(2)
    twin = PlainTwin.of(body_of(observation), observation)
    names = [name for name in twin.quantities if name.startswith(HAND)]
    assert names == [f"hand_{hand}_{axis}" for hand in (1, 2) for axis in "xyz"]
    assert all(twin.quantities[name].bounds == (-ELSEWHERE, ELSEWHERE) for name in names)
    away = moved(twin, hand_2_y=0.004) - moved(twin)
    late = observation.times >= EASED
    second = twin.hands == 1
    assert 0 < second.sum() < len(second)
    np.testing.assert_allclose(
        away[late][:, second], np.broadcast_to([0, 0.004, 0], away[late][:, second].shape)
    )
    assert not away[:, ~second].any()
    assert not away[0].any()
    assert (np.diff(away[:, second, 1], axis=0) >= -1e-12).all()


def test_many_worlds_have_their_hands_each_elsewhere():
    observation = chain(2)
    twin = PlainTwin.of(body_of(observation), observation)
    some = {name: [q.start, q.start] for name, q in twin.quantities.items()} | {"hand_1_x": [0.0, 0.003]}
    world = twin.world({name: torch.tensor(value).double()[:, None] for name, value in some.items()})
    assert world.controls is not None
    for each, value in enumerate(some["hand_1_x"]):
        np.testing.assert_allclose(world.controls[:, each], moved(twin, hand_1_x=value), atol=1e-6)


def test_of_many_hands_none_is_taken_to_be_elsewhere():
    observation = chain(3)
    twin = PlainTwin.of(body_of(observation), observation)
    assert not [name for name in twin.quantities if name.startswith(HAND)]
    np.testing.assert_allclose(moved(twin)[0, :, 0], twin.controls[0, :, 0], atol=0.02)


def test_a_hand_that_nothing_goes_with_holds_nothing_and_says_how_far_it_is():
    """Within arm's reach of the end, and beyond it: but the end is held by another, and stays where it is."""
    observation = chain(2)
    far = np.array([0.85, 0.0, 1.0]) + 0.3 * np.sin(9.0 * observation.times)[:, None] * [0.0, 1.0, 0.0]
    controllers = np.concatenate([observation.controllers, far[:, None].astype(np.float32)], axis=1)
    watched = replace(observation, controllers=controllers)
    twin = PlainTwin.of(body_of(watched), watched)
    assert twin.idle == [pytest.approx(0.25, abs=0.01)]
    assert not PlainTwin.of(body_of(observation), observation).idle
