"""The kernel follows any law of springs: what its function computes, and what it remembers."""

from collections.abc import Mapping
from typing import ClassVar

import pytest
import torch

from model.gap.effects.grip_slip import SlippingGrip
from model.simulator.forces.base import AxialForce
from model.simulator.forces.spring import Spring
from model.simulator.kernel import program
from model.simulator.kernel.cuda import program as cuda_program
from model.simulator.parameters import Constant

by_both = pytest.mark.usefixtures("engine")
"""Once with the processor's kernel, once with that of CUDA."""


class Plastic(AxialForce):
    """Yields beyond a strain, creeps back, and stiffens; everything a law may do, with two memories."""

    name = "plastic"
    where = "springs"
    constants: ClassVar[Mapping[str, Constant]] = {
        "modulus": Constant("N/m", "springs", (1.0, 100.0)),
        "yield_strain": Constant("1", "scene", (0.01, 0.5)),
        "recovery": Constant("1/s", "springs", (0.0, 10.0)),
    }
    memory: ClassVar[Mapping[str, float]] = {"flow": 0.0, "work": 0.0}

    def __init__(self, modulus, yield_strain, recovery):
        super().__init__(modulus=modulus, yield_strain=yield_strain, recovery=recovery)

    @staticmethod
    def law(length, rate, rest_length, modulus, yield_strain, recovery, flow, work, dt):
        strain = length / rest_length - 1.0 - flow
        excess = torch.abs(strain) - yield_strain
        slipped = torch.where(excess > 0, torch.where(strain > 0, excess, -excess), 0.0)
        elastic = strain - slipped
        tension = modulus * rest_length * torch.tanh(elastic) * torch.exp(-work) + 0.01 * rate
        return tension, (flow + slipped) * (1.0 - recovery * dt), work + torch.sqrt(slipped**2 + 1e-12) * 0.1


@by_both
@pytest.mark.parametrize("checkpoint", [False, True])
def test_laws_with_memory(scene, apart, monkeypatch, checkpoint):
    generator = torch.Generator().manual_seed(0)
    law = [
        (torch.rand(size, generator=generator, dtype=torch.float64) * high).requires_grad_()
        for size, high in ((260, 50.0), ((), 0.02), (260, 5.0))
    ]
    made = scene(forces=[Plastic(*law)], ground=None)
    made.leaves.update(zip(("modulus", "yield_strain", "recovery"), law, strict=True))
    expected, slow = made.roll("torch")
    if checkpoint:
        monkeypatch.setattr(program, "STORAGE", 2**20)  # some ten pieces
        monkeypatch.setattr(cuda_program, "STORAGE", 2**20)
    found, fast = made.roll("kernel", checkpoint=checkpoint)
    assert float(expected.end.memory["plastic.flow"].detach().abs().max()) > 0.01, "nothing yielded"
    assert apart(found.points, expected.points) < 1e-12
    for name in ("plastic.flow", "plastic.work"):
        assert apart(found.end.memory[name], expected.end.memory[name]) < 1e-11
    for name, gradient in slow.items():
        if gradient is not None:
            assert apart(fast[name], gradient) < 1e-9, name


class Motley(AxialForce):
    """No physics, but every operation that a law may use."""

    name = "motley"
    constants: ClassVar[Mapping[str, Constant]] = {"scale": Constant("N", "springs", (0.0, 1.0))}

    def __init__(self, scale):
        super().__init__(scale=scale)

    @staticmethod
    def law(length, rate, rest_length, scale):
        strain = length / rest_length - 1.0
        some = ((strain > 0.01) & (rate < 0.5)) | ~(strain >= -0.02)
        waves = (
            torch.sin(9.0 * strain) * torch.cos(strain) + torch.log(length) - torch.exp(-torch.abs(strain))
        )
        bounded = torch.minimum(strain, 0.1 * rate) - torch.maximum(rate, strain).clamp(-0.3, 0.3)
        powers = length**1.7 + (1.0 + strain) ** -3 + torch.sqrt(length) + torch.tanh(rate)
        return scale * torch.where(some, waves + bounded, 0.3 * powers * (1.0 + (rate > 0)))


@by_both
def test_every_operation_of_a_law(scene, apart):
    scale = torch.full((260,), 0.05, dtype=torch.float64).requires_grad_()
    made = scene(forces=[Motley(scale)], ground=None)
    made.leaves.update(scale=scale)
    expected, slow = made.roll("torch")
    found, fast = made.roll("kernel")
    without, _ = scene(ground=None).roll("kernel")
    assert apart(without.points, expected.points) > 1e-4, "it does nothing"
    assert apart(found.points, expected.points) < 1e-12
    for name in ("scale", "rest_length", "positions", "velocities"):
        assert apart(fast[name], slow[name]) < 1e-9, name


@by_both
def test_springs_and_grips_remember_side_by_side(scene, apart):
    stiffness = torch.full((12,), 40.0, dtype=torch.float64).requires_grad_()
    rate = torch.tensor(20.0, dtype=torch.float64).requires_grad_()
    made = scene(forces=[Plastic(30.0, 0.005, 1.0), SlippingGrip(stiffness, rate, 0.01)], ground=None)
    made.leaves.update(grip=stiffness, rate=rate)
    expected, slow = made.roll("torch")
    found, fast = made.roll("kernel")
    assert float(expected.end.memory["grip_slip.slip"].detach().max()) > 1e-3, "nothing slipped"
    assert apart(found.points, expected.points) < 1e-12
    for name, memory in expected.end.memory.items():
        assert apart(found.end.memory[name], memory) < 1e-11, name
    for name in ("grip", "rate", "stiffness", "controls"):
        assert apart(fast[name], slow[name]) < 1e-9, name


@by_both
def test_a_rollout_goes_on_with_what_its_springs_remember(scene, apart):
    made = scene(forces=[Plastic(30.0, 0.005, 1.0)], ground=None)
    with torch.no_grad():
        fast = made.simulator.with_backend("kernel")
        whole = fast.rollout(made.state(), made.controls, substeps=40)
        half = fast.rollout(made.state(), made.controls[:3], substeps=40)
        rest = fast.rollout(half.end, made.controls[2:], substeps=40)
    assert apart(rest.points[-1], whole.points[-1]) < 1e-14


@by_both
def test_the_law_is_the_terms_own(scene, apart, monkeypatch):
    """Changing the law of a term changes what the kernel does, in step with the oracle."""

    class Cubic(Spring):
        @staticmethod
        def law(length, rest_length, stiffness):
            stretch = length - rest_length
            return stiffness * stretch * (1.0 + 1e4 * stretch**2)

    made = scene(forces=[Cubic(40.0)])
    plain = scene(forces=[Spring(40.0)])
    with torch.no_grad():
        runs = [
            s.simulator.with_backend("kernel").rollout(s.state(), s.controls, substeps=60)
            for s in (made, plain)
        ]
        oracle = made.simulator.with_backend("torch").rollout(made.state(), made.controls, substeps=60)
    assert apart(runs[0].points, oracle.points) < 1e-12
    assert apart(runs[1].points, oracle.points) > 1e-6
