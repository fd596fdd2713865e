"""The kernel and forces on small groups of points: bending, volumes, wind."""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
import torch

from model.gap.effects.plastic_bending import PlasticBending
from model.simulator.forces.bending import Bending
from model.simulator.forces.curved_bending import CurvedBending
from model.simulator.forces.stencil import StencilForce
from model.simulator.forces.volume import Volume
from model.simulator.kernel import layout
from model.simulator.kernel.corners import trace_corners
from model.simulator.kernel.expression import Untraceable
from model.simulator.parameters import Constant

by_both = pytest.mark.usefixtures("engine")
"""Once with the processor's kernel, once with that of CUDA."""


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


class InTime(Wind):
    """A law that asks how long a step is, which only what is remembered may."""

    name = "in_time"

    @staticmethod
    def law(velocities, area, dt):
        return (tuple(-area * dt * each for each in velocities[0]),)


def test_only_what_is_remembered_knows_how_long_a_step_is():
    with pytest.raises(Untraceable, match="it asks for 'dt'"):
        trace_corners(InTime, (("area", True), ("speed", False)))


def test_a_law_of_no_groups_remembers_nothing(scene, apart):
    made = scene()
    none = CurvedBending(torch.zeros((0, 3), dtype=torch.long), 1e-6, 0.05)
    idle = replace(made, simulator=made.simulator.with_force(none))
    for backend in ("torch", "kernel"):
        found, _ = idle.roll(backend, substeps=60)
        expected, _ = made.roll(backend, substeps=60)
        assert torch.equal(found.points, expected.points)
        assert not found.end.memory


@pytest.fixture
def yielding(scene):
    """A scene whose rows of points keep their bends, with leaves for the constants."""

    def build(dtype=torch.float64, batch=()):
        rng = np.random.default_rng(3)
        made = scene(dtype, batch=batch)
        rows = torch.from_numpy(np.stack([rng.permutation(61)[:3] for _ in range(19)]))
        laws = {
            "bending_stiffness": torch.tensor(rng.uniform(1e-6, 1e-5, 19)),
            "yield_turn": torch.tensor(rng.uniform(1e-3, 0.05, (*batch, 19))),
            "flow_rate": torch.tensor(20.0),
        }
        laws = {name: value.to(dtype).requires_grad_() for name, value in laws.items()}
        made.leaves.update(laws)
        made = replace(made, simulator=made.simulator.with_force(PlasticBending(rows, span=0.05, **laws)))
        return made

    return build


@by_both
@pytest.mark.parametrize("batch", [(), (2,)])
@pytest.mark.parametrize("checkpoint", [False, True])
def test_what_groups_of_points_remember(yielding, scene, apart, batch, checkpoint):
    made = yielding(batch=batch)
    expected, slow = made.roll("torch", substeps=60)
    found, fast = made.roll("kernel", substeps=60, checkpoint=checkpoint)
    without, _ = scene(batch=batch).roll("kernel", substeps=60)
    assert apart(without.points, expected.points) > 1e-4, "it does nothing"
    assert apart(found.points, expected.points) < 1e-12
    for name, memory in expected.end.memory.items():
        assert apart(found.end.memory[name], memory) < 1e-11, name
    for name, gradient in slow.items():
        assert apart(fast[name], gradient) < 1e-9, name
