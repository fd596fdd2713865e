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
