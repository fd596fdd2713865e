"""The kernel says what the torch oracle says: values and gradients."""

import platform

import pytest
import torch

from model.errors import InputError
from model.simulator.kernel import build
from model.simulator.system import State

by_both = pytest.mark.usefixtures("engine")
"""Once with the processor's kernel, once with that of CUDA."""


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
def test_batches_of_parameters_and_of_states(scene, apart):
    made = scene(batch=(2,))
    expected, slow = made.roll("torch")
    found, fast = made.roll("kernel")
    assert found.points.shape == (4, 2, 61, 3)
    assert apart(found.points, expected.points) < 1e-12
    for name, gradient in slow.items():
        assert fast[name].shape == gradient.shape
        assert apart(fast[name], gradient) < 1e-9, name


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
