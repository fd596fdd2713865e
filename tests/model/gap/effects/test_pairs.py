"""Two effects at work together, in either order, in many worlds at once."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
import torch

from model.gap.bodies.body import body_of
from model.gap.effects import ALL_EFFECTS
from model.gap.hypothesis import Hypothesis
from model.gap.plain import PlainTwin

SLOWER = 0.02
"""Times of the recordings: so few steps in time are fine enough."""
STEPS = {"last": 2, "substeps": 2}


@pytest.fixture
def standing(short, hung, egg):
    """A function: a rope, a sheet or a solid over a ground, held, and carried on by its hand."""

    def of(shape):
        still = hung if shape == "sheet" else short
        if shape == "solid":
            still = replace(
                still,
                points=np.repeat(egg[None].astype(np.float32), len(still.times), 0),
                controllers=still.controllers - still.controllers[0] + egg[:1].astype(np.float32),
            )
        lowest = float(still.points[..., 2].min())
        return replace(still, times=SLOWER * still.times, ground_height=lowest - 0.001)

    return of


@pytest.mark.parametrize("shape", ["rope", "sheet", "solid"])
def test_pairs_of_many_worlds_are_as_one_by_one(shape, standing):
    """A first effect may give each world masses or laws of its own, on which the second builds."""
    still = standing(shape)
    plain = Hypothesis(PlainTwin.of(body_of(still, shape), still))
    able = [kind() for kind in ALL_EFFECTS if kind().unable(_usual(plain)) is None]
    assert len(able) > 14
    for pair in permutations(able, 2):
        if pair[1].unable(_usual(plain.with_effect(pair[0]))) is not None:
            continue
        made = replace(plain, effects=pair)
        both = {name: (q.start, _other(q)) for name, q in made.quantities.items()}
        many = made({name: torch.tensor(each).double().unsqueeze(-1) for name, each in both.items()})
        first, second = _points(many).unbind(1)
        alone = _points(made.at({name: other for name, (_, other) in both.items()}))
        told = f"{pair[0].name}, {pair[1].name}"
        assert torch.allclose(second, alone, rtol=0, atol=1e-9), told
        assert float((first - second).abs().max()) > 1e-7, told


def _usual(hypothesis):
    return hypothesis.at({name: quantity.start for name, quantity in hypothesis.quantities.items()})


def _other(quantity):
    """A value beside where fits start."""
    low, high = quantity.bounds
    return min(max(1.1 * quantity.start, low), high)


def _points(world):
    """By plain torch, in float64: a kernel would be compiled for each pair."""
    simulator = world.simulator.with_backend("torch").double()
    with torch.no_grad():
        return replace(world, simulator=simulator).rollout(**STEPS).points
