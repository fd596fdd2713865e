from dataclasses import replace

import numpy as np
import pytest
import torch

from model.gap.bodies.body import body_of
from model.gap.plain import PlainTwin
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


def test_a_hand_that_nothing_goes_with_holds_nothing_and_says_how_far_it_is(chain):
    """Within arm's reach of the end, and beyond it: but the end is held by another, and stays where it is."""
    observation = chain(2)
    far = np.array([0.85, 0.0, 1.0]) + 0.3 * np.sin(9.0 * observation.times)[:, None] * [0.0, 1.0, 0.0]
    controllers = np.concatenate([observation.controllers, far[:, None].astype(np.float32)], axis=1)
    watched = replace(observation, controllers=controllers)
    twin = PlainTwin.of(body_of(watched), watched)
    assert twin.idle == [pytest.approx(0.25, abs=0.01)]
    np.testing.assert_array_equal(twin.holders, [0, 1])
    busy = PlainTwin.of(body_of(observation), observation)
    assert not busy.idle
    np.testing.assert_array_equal(busy.holders, [0, 1])


def test_of_a_thick_rope_it_is_fitted_how_it_bends(thick_rope):
    (thick, _), (thin, _) = thick_rope(0), thick_rope(0, radius=0.001)
    twins = [PlainTwin.of(body_of(seen, "rope"), seen) for seen in (thick, thin)]
    assert ["bending" in twin.quantities for twin in twins] == [True, False]
    usual = {name: torch.tensor(q.start).double() for name, q in twins[0].quantities.items()}
    soft, stiff = (
        twins[0].world({**usual, "bending": torch.tensor(share).double()}).simulator.force("slight_bending")
        for share in (0.1, 1.0)
    )
    ratio = stiff.value("bending_stiffness") / soft.value("bending_stiffness")
    np.testing.assert_allclose(ratio.numpy(), 10.0, rtol=1e-5)


def test_of_a_thick_rope_it_is_fitted_how_much_of_its_first_shape_it_remembers(thick_rope):
    (thick, _), (thin, _) = thick_rope(0), thick_rope(0, radius=0.001)
    twins = [PlainTwin.of(body_of(seen, "rope"), seen) for seen in (thick, thin)]
    assert ["memory_of_shape" in twin.quantities for twin in twins] == [True, False]
    usual = {name: torch.tensor(q.start).double() for name, q in twins[0].quantities.items()}
    straight = twins[0].world({**usual, "memory_of_shape": torch.tensor(0.0).double()})
    assert float(straight.simulator.force("slight_bending").value("rest_turn").abs().max()) == 0.0


def test_a_thick_rope_lies_with_its_middle_above_the_ground(thick_rope):
    seen, _ = thick_rope(0, lying=True)
    twin = PlainTwin.of(body_of(seen, "rope"), seen)
    usual = {name: torch.tensor(q.start).double() for name, q in twin.quantities.items()}
    world = twin.world(usual)
    assert world.ground_height == twin.ground_height == twin.body.above > 0.006
    thin, _ = thick_rope(0, radius=0.001, lying=True)
    assert PlainTwin.of(body_of(thin, "rope"), thin).ground_height == 0.0


def cloth(fall: float = 0.0) -> Observation:
    """Points on a flat cloth of 0.3 × 0.2 m that a hand holds by the middle of its upper edge.

    Args:
        fall: How much of a free fall it goes through.
    """
    u, v = np.meshgrid(np.linspace(0.0, 0.3, 16), np.linspace(0.0, 0.2, 11), indexing="ij")
    places = np.stack([u, 0 * u, 1.0 - v], -1).reshape(-1, 3)
    times = np.arange(12) / 30.0
    hands = places[[66, 77, 88, 99]] + np.array([0.0, 0.004, 0.0])
    down = np.stack([0 * times, 0 * times, -0.5 * fall * 9.81 * times**2], -1)[:, None]
    points = places + down + np.random.default_rng(0).normal(0.0, 5e-4, (12, *places.shape))
    return Observation(
        times, points.astype(np.float32), np.repeat(hands[None], 12, 0).astype(np.float32), 0.0
    )


def moved(twin: PlainTwin, prestress: float) -> float:
    """How far points usually are from where they began after 0.1 s [m]."""
    usual = {name: torch.tensor(q.start).double() for name, q in twin.quantities.items()}
    held = {"prestress": prestress, "grip": 20.0, "stiffness": 4.0 * float(usual["stiffness"])}
    values = {**usual, **{name: torch.tensor(value).double() for name, value in held.items()}}
    made = twin.world(values, torch.float64).rollout(last=3)
    return float((made.points[3] - made.points[0]).norm(dim=-1).mean())


def test_a_cloth_that_hangs_is_at_rest_though_its_springs_hardly_press():
    hanging = cloth()
    twin = PlainTwin.of(body_of(hanging, "sheet"), hanging)
    assert (twin.rest.tensions < 0.0).any(), "no pull alone bears it"
    assert moved(twin, 1.0) < 0.25 * moved(twin, 0.0)


def test_a_cloth_that_falls_is_not():
    falling = cloth(1.0)
    twin = PlainTwin.of(body_of(falling, "sheet"), falling)
    assert not twin.rest.tensions.any()
    assert not twin.rest.supports.any()
