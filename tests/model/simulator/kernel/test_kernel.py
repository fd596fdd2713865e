"""The kernel says what the torch oracle says: values and gradients."""

import platform
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
import torch

from model.errors import InputError
from model.gap.effects.grip_slip import SlippingGrip
from model.simulator.backend import FallbackWarning
from model.simulator.contacts.self_collision import SelfCollision
from model.simulator.forces.base import AxialForce
from model.simulator.forces.bending import Bending
from model.simulator.forces.spring import Spring
from model.simulator.forces.stencil import StencilForce
from model.simulator.forces.unprojected_dashpot import UnprojectedDashpot
from model.simulator.forces.volume import Volume
from model.simulator.kernel import build, layout, program
from model.simulator.kernel.cuda import program as cuda_program
from model.simulator.parameters import Constant
from model.simulator.system import State

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


EXACT = {torch.float64: 1e-11, torch.float32: 2e-5}


@by_both
@pytest.mark.parametrize("dtype", EXACT)
@pytest.mark.parametrize("checkpoint", [False, True])
def test_values_and_gradients_are_those_of_the_oracle(scene, apart, dtype, checkpoint):
    made = scene(dtype)
    expected, slow = made.roll("torch")
    found, fast = made.roll("kernel", checkpoint=checkpoint)
    assert float(expected.points[..., 2].detach().min()) < 1e-3, "nothing touched the ground"
    assert apart(found.points, expected.points) < EXACT[dtype]
    assert apart(found.velocities, expected.velocities) < EXACT[dtype]
    for name, gradient in slow.items():
        assert apart(fast[name], gradient) < 100 * EXACT[dtype], name


@by_both
def test_single_precision_is_within_its_bars_of_the_double_oracle(scene, apart):
    _, expected = scene(torch.float64).roll("torch", substeps=100)
    _, found = scene(torch.float32).roll("kernel", substeps=100)
    assert apart(found["stiffness"], expected["stiffness"]) < 1e-4
    assert apart(found["friction"], expected["friction"]) < 1e-3
    assert apart(found["restitution"], expected["restitution"]) < 1e-3


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
def test_batches_of_parameters_and_of_states(scene, apart):
    made = scene(batch=(2,))
    expected, slow = made.roll("torch")
    found, fast = made.roll("kernel")
    assert found.points.shape == (4, 2, 61, 3)
    assert apart(found.points, expected.points) < 1e-12
    for name, gradient in slow.items():
        assert fast[name].shape == gradient.shape
        assert apart(fast[name], gradient) < 1e-9, name


class Wind(StencilForce):
    """A law of single points that sees velocities: quadratic drag in moving air."""

    name = "wind"
    size = 1
    constants: ClassVar[Mapping[str, Constant]] = {
        "area": Constant("m^2", "stencils", (1e-5, 1e-3)),
        "speed": Constant("m/s", "scene", (0.0, 5.0)),
    }

    def __init__(self, stencils, area, speed):
        super().__init__(stencils, area=area, speed=speed)

    @staticmethod
    def law(velocities, area, speed):
        ((u, v, w),) = velocities
        size = torch.sqrt((u - speed) ** 2 + v**2 + w**2 + 1e-9)
        return (tuple(-0.6 * area * size * each for each in (u - speed, v, w)),)


@pytest.fixture
def stenciled(scene):
    """A scene whose points also bend, keep volumes and meet the wind, with leaves for their constants."""

    def build(dtype=torch.float64, batch=()):
        rng = np.random.default_rng(2)
        chosen = [torch.from_numpy(np.stack([rng.permutation(61)[:n] for _ in range(19)])) for n in (3, 4)]
        made = scene(dtype, batch=batch)
        places = made.leaves["positions"].detach()
        corners = places[chosen[1]]
        edges = corners[:, 1:] - corners[:, :1]
        volumes = torch.linalg.det(edges) / 6.0
        swapped = torch.where((volumes < 0).unsqueeze(1), chosen[1][:, [0, 2, 1, 3]], chosen[1])
        laws = {
            "bending_stiffness": torch.tensor(rng.uniform(1e-6, 1e-5, 19)),
            "rest_turn": torch.tensor(rng.uniform(0.5, 3.0, (*batch, 19))),
            "bulk_modulus": torch.tensor(3e3),
            "rest_volume": 1.1 * volumes.abs().double() + 1e-7,
            "area": torch.tensor(rng.uniform(1e-5, 1e-3, 61)),
            "speed": torch.tensor(1.5),
        }
        laws = {name: value.to(dtype).requires_grad_() for name, value in laws.items()}
        made.leaves.update(laws)
        simulator = made.simulator
        simulator = simulator.with_force(
            Bending(chosen[0], laws["bending_stiffness"], 0.05, laws["rest_turn"])
        )
        simulator = simulator.with_force(Volume(swapped, laws["bulk_modulus"], laws["rest_volume"]))
        simulator = simulator.with_force(Wind(torch.arange(61).unsqueeze(1), laws["area"], laws["speed"]))
        return replace(made, simulator=simulator)

    return build


@by_both
@pytest.mark.parametrize("checkpoint", [False, True])
def test_forces_on_small_groups_of_points(stenciled, scene, apart, checkpoint):
    made = stenciled()
    expected, slow = made.roll("torch", substeps=100)
    found, fast = made.roll("kernel", substeps=100, checkpoint=checkpoint)
    without, _ = scene().roll("kernel", substeps=100)
    assert apart(without.points, expected.points) > 1e-3, "they do nothing"
    assert apart(found.points, expected.points) < 1e-12
    for name, gradient in slow.items():
        assert apart(fast[name], gradient) < 1e-9, name


@by_both
def test_groups_of_points_in_batches(stenciled, apart):
    made = stenciled(batch=(2,))
    expected, slow = made.roll("torch", substeps=60)
    found, fast = made.roll("kernel", substeps=60)
    assert apart(found.points, expected.points) < 1e-12
    for name, gradient in slow.items():
        assert apart(fast[name], gradient) < 1e-9, name


def test_groups_of_points_are_as_exact_in_single_precision_as_the_oracle(stenciled, apart):
    exact, _ = stenciled().roll("torch", substeps=60)
    runs = [stenciled(torch.float32).roll(backend, substeps=60)[0] for backend in ("torch", "kernel")]
    oracle, kernel = (apart(run.points, exact.points) for run in runs)
    assert kernel < 3.0 * oracle + 1e-7


def test_threads_change_nothing(stenciled, monkeypatch):
    made = stenciled()
    monkeypatch.setattr(layout, "PIECE", 4)
    results = []
    before = torch.get_num_threads()
    for threads in (1, 2, 3):
        torch.set_num_threads(threads)
        try:
            results.append(made.roll("kernel", substeps=100))
        finally:
            torch.set_num_threads(before)
    for rollout, gradients in results[1:]:
        assert torch.equal(rollout.points, results[0][0].points)
        assert all(torch.equal(gradients[name], results[0][1][name]) for name in gradients)


@by_both
def test_gradients_alone_where_they_are_wanted(scene, apart):
    made = scene()
    _, all_of_them = made.roll("kernel")
    for name in list(made.leaves):
        for other, leaf in made.leaves.items():
            leaf.requires_grad_(other == name)
        _, alone = made.roll("kernel")
        assert apart(alone[name], all_of_them[name]) < 1e-12, name


@by_both
def test_a_free_system_without_springs(scene, apart):
    made = scene()
    system = made.simulator.system
    lone = type(system)(
        points=system.points, mass=1.0, springs=torch.zeros(0, 2).long(), rest_length=torch.zeros(0)
    )
    forces = [made.simulator.force("gravity"), made.simulator.force("drag")]
    simulator = type(made.simulator)(lone, forces, [made.simulator.contact("ground")])
    with torch.no_grad():
        runs = [simulator.with_backend(b).rollout(made.state(), frames=3) for b in ("torch", "kernel")]
    assert apart(runs[1].points, runs[0].points) < 1e-14


@by_both
def test_points_that_coincide_pull_nowhere(scene, apart):
    made = scene()
    with torch.no_grad():
        places = made.leaves["positions"].clone()
        first, second = made.simulator.system.springs[0]
        places[first] = places[second]
        start = State(places, torch.zeros_like(places))
        runs = [made.simulator.with_backend(b).rollout(start, made.controls[:2]) for b in ("torch", "kernel")]
    assert apart(runs[1].points, runs[0].points) < 1e-12


@by_both
def test_what_is_not_finite_is_reported(scene):
    made = scene()
    with torch.no_grad():
        made.leaves["velocities"][7] = float("inf")
    with pytest.raises(InputError, match="is not finite, driven by"):
        made.simulator.with_backend("kernel").rollout(made.state(), made.controls, substeps=40)


class Jagged(AxialForce):
    """A law that no symbol follows."""

    name = "jagged"
    constants: ClassVar[Mapping[str, Constant]] = {"stiffness": Constant("N/m", "scene", (1.0, 2.0))}

    def __init__(self):
        super().__init__(stiffness=1.0)

    @staticmethod
    def law(length, stiffness):
        return torch.floor(length * 1e9) * 1e-9 * stiffness


@by_both
@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (lambda s: s.with_force(UnprojectedDashpot(0.1)), "the force 'unprojected_dashpot'"),
        (lambda s: s.with_force(Jagged()), "law of 'jagged' cannot be traced: torch.floor"),
    ],
)
@pytest.mark.filterwarnings("error")
def test_what_it_cannot_do_is_named_and_left_to_the_oracle(scene, change, complaint):
    made = scene()
    simulator = change(made.simulator)
    with pytest.raises(InputError, match=complaint):
        simulator.with_backend("kernel").rollout(made.state(), made.controls[:2], substeps=40)
    with pytest.warns(FallbackWarning, match=complaint):
        found = simulator.rollout(made.state(), made.controls[:2], substeps=40)
    expected = simulator.with_backend("torch").rollout(made.state(), made.controls[:2], substeps=40)
    assert torch.equal(found.points, expected.points)


def test_self_collision_is_no_part_of_it(scene):
    made = scene()
    simulator = made.simulator.with_contact(SelfCollision(made.simulator.system, 0.01, 0.0, 0.0))
    with pytest.raises(InputError, match="the contact 'self_collision'"):
        simulator.with_backend("kernel").rollout(made.state(), made.controls[:2], substeps=40)


@pytest.mark.filterwarnings("error")
def test_without_a_compiler_the_oracle_serves_and_says_so(scene, monkeypatch):
    made = scene()
    monkeypatch.setenv("PATH", "")
    build.load.cache_clear()
    with pytest.warns(FallbackWarning, match=r"no C\+\+ compiler"):
        found = made.simulator.rollout(made.state(), made.controls[:2], substeps=40)
    build.load.cache_clear()
    expected = made.simulator.with_backend("torch").rollout(made.state(), made.controls[:2], substeps=40)
    assert torch.equal(found.points, expected.points)


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


@pytest.mark.parametrize("dtype", EXACT)
def test_it_runs_on_plain_processors_too(scene, apart, monkeypatch, dtype):
    """The same text without the instructions of this machine: what other processors get."""
    plain = "-march=x86-64" if platform.machine() == "x86_64" else "-mcpu=generic"
    monkeypatch.setattr(build, "FLAGS", (*build.FLAGS, plain))
    build.load.cache_clear()
    made = scene(dtype)
    found, fast = made.roll("kernel")
    build.load.cache_clear()
    expected, slow = made.roll("torch")
    assert apart(found.points, expected.points) < EXACT[dtype]
    assert apart(fast["stiffness"], slow["stiffness"]) < 100 * EXACT[dtype]
