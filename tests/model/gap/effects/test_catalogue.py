"""What every effect of the catalogue must keep."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
import torch

from model.gap.effects import (
    ALL_EFFECTS,
    Anisotropy,
    GravityTilt,
    GripSlip,
    MassHeterogeneity,
    SelfContact,
    StrainStiffening,
)
from model.gap.effects.base import Effect
from model.schema import EffectName
from model.simulator.build import build_simulator
from model.simulator.contacts.self_collision import SelfCollision
from model.simulator.forces.gravity import Gravity

every_effect = pytest.mark.parametrize("kind", ALL_EFFECTS, ids=lambda kind: kind.name)
BODY_ONLY = {"strain_stiffening", "viscoelasticity", "plasticity", "damage", "tension_only", "anisotropy"}


def start(effect: Effect) -> dict[str, torch.Tensor]:
    return {
        name: torch.tensor(quantity.start, dtype=torch.float64, requires_grad=True)
        for name, quantity in effect.quantities.items()
    }


def absent(effect: Effect) -> dict[str, torch.Tensor]:
    return {
        name: torch.tensor(effect.absent.get(name, quantity.start), dtype=torch.float64)
        for name, quantity in effect.quantities.items()
    }


def strong(effect: Effect) -> dict[str, torch.Tensor]:
    """Three times what it starts with, in what makes it present."""
    values = start(effect)
    for name in effect.absent:
        low, high = effect.quantities[name].bounds
        values[name] = (3.0 * values[name].detach()).clamp(low, high).requires_grad_()
    return values


def test_the_contract_names_them():
    assert tuple(kind.name for kind in ALL_EFFECTS) == tuple(
        sorted(get_args(EffectName), key=[kind.name for kind in ALL_EFFECTS].index)
    )
    assert len(ALL_EFFECTS) == len(get_args(EffectName)) == 17


@every_effect
def test_says_whether_it_acts_on_top_of_itself(kind, block):
    """Twice there, what stacks moves otherwise than once; what does not moves the same, exactly."""
    effect, values = kind(), strong(kind())
    with torch.no_grad():
        once = effect.apply(block, values)
        twice = effect.apply(once, values)
        same = torch.equal(once.rollout(substeps=80).points, twice.rollout(substeps=80).points)
    assert same != kind.stacks


@every_effect
def test_documents_itself(kind):
    assert kind.__doc__
    assert "Reference:" in kind.source
    assert set(kind.absent) <= set(kind.quantities)
    assert set(kind.before) <= set(kind.quantities)
    for name, value in kind.before.items():
        assert (
            value == kind.absent.get(name)
            or kind.quantities[name].bounds[0] <= value <= kind.quantities[name].bounds[1]
        )
    assert set(kind.confused_with) <= set(get_args(EffectName)) - {kind.name}
    assert kind.confused_with
    for quantity in kind.quantities.values():
        assert quantity.bounds[0] <= quantity.start <= quantity.bounds[1]
        assert quantity.bounds[0] > 0 or not quantity.log


@every_effect
def test_changes_nothing_where_absent(kind, block):
    effect = kind()
    with torch.no_grad():
        plain = block.rollout(substeps=80)
        same = effect.apply(block, absent(effect)).rollout(substeps=80)
    torch.testing.assert_close(same.points, plain.points, rtol=0, atol=1e-11)


@every_effect
def test_moves_the_body_where_present(kind, block):
    effect = kind()
    assert effect.unable(block) is None
    with torch.no_grad():
        plain = block.rollout(substeps=80)
        other = effect.apply(block, strong(effect)).rollout(substeps=80)
    change = (other.points - plain.points).norm(dim=-1).max()
    assert change > (1e-6 if kind.name == "self_collision" else 2e-4)


@every_effect
def test_what_it_has_no_quantity_for_in_a_body_changes_nothing_there(kind, block):
    effect = kind()
    less, values = effect.within(block), strong(effect)
    with torch.no_grad():
        whole = effect.apply(block, values).rollout(substeps=80).points
        own = less.apply(block, {name: values[name] for name in less.quantities}).rollout(substeps=80).points
    assert (less.name, less.acts, less.stacks) == (effect.name, effect.acts, effect.stacks)
    assert torch.equal(own, whole)


@every_effect
def test_gradients_reach_every_quantity(kind, smooth):
    """Against finite differences, through the kernel where it serves; here no quantity does nothing."""
    effect = kind().within(smooth)
    values = strong(effect)

    def loss(chosen):
        points = (
            effect.apply(smooth, chosen)
            .rollout(last=3 if kind.name == "self_collision" else 8, substeps=60)
            .points
        )
        weights = torch.linspace(1.0, 2.0, points.numel(), dtype=points.dtype).reshape(points.shape)
        return (weights * points).square().sum()

    loss(values).backward()
    for name, value in values.items():
        if (kind.name, name) == ("self_collision", "distance"):  # a choice, not a slope
            continue
        step = 1e-6 * max(1.0, abs(float(value.detach())))
        with torch.no_grad():
            up, down = (loss({**values, name: value + sign * step}) for sign in (1, -1))
        slope = float(up - down) / (2 * step)
        assert value.grad is not None
        assert float(value.grad) == pytest.approx(slope, rel=2e-3, abs=1e-9 * float(up) / step)
        if not (kind.name == "self_collision" and name == "friction"):
            assert float(value.grad) != 0


@every_effect
def test_kernel_and_oracle_agree(kind, block):
    effect = kind()
    world = effect.apply(block, strong(effect))
    with torch.no_grad():
        fast = world.rollout(last=6, substeps=60)
        slow = type(world)(
            world.simulator.with_backend("torch"),
            world.sight,
            world.times,
            world.controls,
            world.ground_height,
        ).rollout(last=6, substeps=60)
    torch.testing.assert_close(fast.points, slow.points, rtol=0, atol=1e-10)


@every_effect
def test_many_values_at_once_are_as_one_by_one(kind, block):
    effect = kind()
    first, second = absent(effect), {name: value.detach() for name, value in strong(effect).items()}
    both = {name: torch.stack([first[name], second[name]]).unsqueeze(-1) for name in first}
    with torch.no_grad():
        together = effect.apply(block, both).rollout(last=6, substeps=60).points
        for i, values in enumerate((first, second)):
            alone = effect.apply(block, values).rollout(last=6, substeps=60).points
            torch.testing.assert_close(together[:, i], alone, rtol=0, atol=1e-10)


@pytest.mark.parametrize("beneath", [GravityTilt, MassHeterogeneity], ids=lambda kind: kind.name)
def test_a_grip_bears_the_weight_of_its_own_world(beneath, block):
    """Not of all that are rolled out beside it, where another effect gives each another weight."""
    values = {**start(beneath()), **start(GripSlip())}
    many = {name: value.detach() * torch.tensor([[1.0], [2.0], [4.0]]) for name, value in values.items()}
    together = _slips(beneath, block, many)
    assert len(together) == 3
    for i in range(3):
        alone = _slips(beneath, block, {name: value[i, 0] for name, value in many.items()})
        torch.testing.assert_close(together[i], alone)


def _slips(beneath, block, values):
    """Load [N] from which each spring of a grip slips, with another effect beneath it."""
    own = {name: values[name] for name in beneath.quantities}
    world = GripSlip().apply(
        beneath().apply(block, own), {name: values[name] for name in GripSlip.quantities}
    )
    return world.simulator.force("grip_slip").value("holding_force")


@every_effect
def test_acts_where_it_is_told(kind, block):
    """A field of zeros is absence; half of the body is not the whole."""
    effect = kind()
    count = len(block.system.points)
    strength = effect.strength(block, strong(effect))
    assert strength.shape == (count,)
    assert float(strength.min()) >= 0
    assert 0.2 < float(strength.max()) <= 1
    if kind.name not in BODY_ONLY:
        return
    with torch.no_grad():
        plain = block.rollout(last=10, substeps=80).points
        nowhere = effect.apply(block, strong(effect), torch.zeros(count)).rollout(last=10, substeps=80).points
        half = (block.system.points[:, 0] > 0.05).double()
        there = effect.apply(block, strong(effect), half).rollout(last=10, substeps=80).points
        everywhere = effect.apply(block, strong(effect)).rollout(last=10, substeps=80).points
    torch.testing.assert_close(nowhere, plain, rtol=0, atol=1e-11)
    assert 0 < (there - plain).norm() != (everywhere - plain).norm()


@every_effect
def test_says_where_it_cannot_act(kind, loose):
    reason = kind().unable(loose)
    free_anywhere = {"quadratic_air_drag", "wind", "mass_heterogeneity", "self_collision"}
    assert (reason is None) == (kind.name in free_anywhere)


def test_what_a_grip_holds_is_told_in_weights(block):
    afloat = block.with_force(Gravity((0.0, 0.0, 0.0)))
    assert "nothing weighs it down" in (GripSlip().unable(afloat) or "")


def test_what_bounced_off_itself_still_does(block):
    bouncy = block.with_contact(SelfCollision(block.system, 0.02, 0.7, 0.3))
    values = {name: torch.tensor(quantity.start) for name, quantity in SelfContact.quantities.items()}
    for world, restitution in ((bouncy, 0.7), (block, 0.0)):
        contact = SelfContact().apply(world, values).simulator.contact("self_collision")
        assert float(contact.value("restitution")) == pytest.approx(restitution)


def test_fibres_mean_nothing_in_a_chain(block):
    """Its springs lie along it wherever it bends: stiffer along them is stiffer."""
    chain = np.stack([np.arange(9), np.arange(1, 10)], -1)
    simulator = build_simulator(
        points=np.linspace([0.0, 0.0, 0.1], [0.2, 0.05, 0.1], 10),
        mass=np.full(10, 0.01),
        springs=chain,
        rest_length=np.full(9, 0.02),
        stiffness=20.0,
    )
    assert "one direction" in (Anisotropy().unable(replace(block, simulator=simulator)) or "")
    assert StrainStiffening().unable(replace(block, simulator=simulator)) is None
