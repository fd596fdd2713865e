"""Rest lengths and hands with which a twin with an effect is at rest as well, against statics."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from model.gap.bodies.body import body_of
from model.gap.effects import Anisotropy, GravityTilt, MassHeterogeneity, StrainStiffening, Viscoelasticity
from model.gap.hypothesis import Hypothesis
from model.gap.plain import PlainTwin

LOAD = {"excess": 4.0, "x": 0.5, "y": 0.5, "z": 0.0, "radius": 0.3}
SOFT = 0.3
"""Of the stiffness where fits begin: a body that hangs long."""


@pytest.fixture
def slab(short, egg):
    """The plain twin of a solid that a hand holds still by one end."""
    points = np.repeat(egg[None].astype(np.float32), len(short.times), 0)
    still = replace(short, points=points, controllers=points[:, :3])
    return PlainTwin.of(body_of(still, "solid"), still)


def soft(hypothesis, **given):
    """The world of a soft twin, wholly at rest in its first frame, with an effect of this strength."""
    values = {name: quantity.start for name, quantity in hypothesis.quantities.items()}
    values |= {"prestress": 1.0, "stiffness": SOFT * values["stiffness"]}
    for effect in hypothesis.effects:
        values |= {f"{effect.name}.{name}": value for name, value in given.items()}
    return hypothesis.at(values)


def stirred(world, start=None):
    """How far points have moved in the time that is seen [m], root mean square."""
    points = world.rollout(start).points
    return float((points[-1] - points[0]).norm(dim=-1).square().mean().sqrt())


@pytest.mark.parametrize("effect", [MassHeterogeneity, GravityTilt])
def test_what_weighs_more_does_not_fall_at_first(slab, effect):
    """Hardly more than the plain twin stirs; far less than it would on rest lengths of the plain one."""
    given = LOAD if effect is MassHeterogeneity else {"about_x": 0.3, "about_y": 0.2}
    hypothesis = Hypothesis(slab, (effect(),))
    plain, world = soft(Hypothesis(slab)), soft(hypothesis, **given)
    strength = {name: torch.tensor(value, dtype=torch.float64) for name, value in given.items()}
    unbalanced = effect().apply(plain, strength)
    assert stirred(world) < 0.4 * stirred(unbalanced)


@pytest.mark.parametrize(
    ("effect", "given"),
    [
        (StrainStiffening, {"stiffening": 300.0}),
        (Anisotropy, {"excess": 3.0, "azimuth": 0.3, "elevation": 0.2, "sharpness": 2.0}),
    ],
)
def test_springs_of_another_law_pull_as_much(slab, effect, given):
    """Stiffer or not, in the first frame each has the tension that it had."""
    hypothesis = Hypothesis(slab, (effect(),))
    plain, world = soft(Hypothesis(slab)), soft(hypothesis, **given)
    assert not torch.equal(plain.system.value("rest_length"), world.system.value("rest_length"))
    pulls = [_pull(one) for one in (plain, world)]
    scale = float(pulls[0].abs().max())
    torch.testing.assert_close(pulls[1], pulls[0], rtol=0.0, atol=1e-5 * scale)


def _pull(world):
    """Of all springs on each point in the first frame [N]."""
    simulator = world.simulator.double()
    points = simulator.system.points
    still, dynamics = torch.zeros_like(points), simulator.dynamics()
    motion = dynamics.motion(simulator.rest_state(), simulator._held())
    total = still
    for term, values in dynamics.forces:
        if term.internal and getattr(term, "where", "") == "springs":
            total = total + term.force(motion, values)
    return total


def test_an_effect_that_is_absent_changes_nothing(slab):
    """The world of no strength is the plain one."""
    for effect, given in (
        (MassHeterogeneity(), {**LOAD, "excess": 0.0}),
        (StrainStiffening(), {"stiffening": 0.0}),
    ):
        plain, world = soft(Hypothesis(slab)), soft(Hypothesis(slab, (effect,)), **given)
        torch.testing.assert_close(world.system.value("rest_length"), plain.system.value("rest_length"))


def test_many_worlds_are_balanced_each_for_itself(slab):
    """As one by one."""
    hypothesis = Hypothesis(slab, (MassHeterogeneity(),))
    values = {name: quantity.start for name, quantity in hypothesis.quantities.items()}
    each = [{**values, "mass_heterogeneity.excess": excess, "prestress": 0.9} for excess in (0.5, 3.0)]
    both = hypothesis(
        {name: torch.tensor([[one[name]] for one in each], dtype=torch.float64) for name in values}
    )
    for number, one in enumerate(each):
        alone = hypothesis.at(one)
        torch.testing.assert_close(
            both.system.value("rest_length")[number], alone.system.value("rest_length")
        )
        torch.testing.assert_close(both.controls[:, number], alone.controls)


def test_what_relaxes_has_relaxed_at_first(slab):
    """A viscous branch beside springs that have long been taut bears nothing; a new one would pull."""
    world = soft(Hypothesis(slab, (Viscoelasticity(),)), branch=5.0, relaxation_time=1.0)
    start = world.simulator.rest_state()
    new = torch.zeros(len(world.system.springs), dtype=start.positions.dtype)
    assert stirred(world) < 0.3 * stirred(
        world, replace(start, memory={"viscoelasticity.viscous_strain": new})
    )
