"""On a real device the kernel says what the oracle says on the processor. Skipped where there is none."""

from dataclasses import replace

import pytest
import torch

from model.simulator.forces.bending import Bending
from model.simulator.forces.volume import Volume
from model.simulator.kernel.cuda import program

pytestmark = [
    pytest.mark.gpu,
    pytest.mark.skipif(not torch.cuda.is_available(), reason="torch sees no CUDA device here"),
]
EXACT = {torch.float64: 1e-11, torch.float32: 2e-5}


def on_device(made):
    return replace(made, simulator=made.simulator.to("cuda"), device="cuda")


@pytest.mark.parametrize("dtype", EXACT)
@pytest.mark.parametrize("batch", [(), (2,)])
@pytest.mark.parametrize("checkpoint", [False, True])
def test_values_and_gradients(scene, apart, monkeypatch, dtype, batch, checkpoint):
    made = scene(dtype, batch=batch)
    expected, slow = made.roll("torch")
    if checkpoint:
        monkeypatch.setattr(program, "STORAGE", 2**20)
    found, fast = on_device(made).roll("kernel", checkpoint=checkpoint)
    assert found.points.device.type == "cuda"
    assert apart(found.points.cpu(), expected.points) < EXACT[dtype]
    for name, gradient in slow.items():
        assert apart(fast[name].cpu(), gradient) < 100 * EXACT[dtype], name


def test_small_groups_of_points(scene, apart):
    groups = torch.arange(60).reshape(15, 4)
    forces = [Volume(groups, 1e3, torch.full((15,), 1e-6)), Bending(groups[:, :3], 1e-5, 0.05, 1.0)]
    made = scene(forces=forces)
    expected, slow = made.roll("torch", substeps=100)
    found, fast = on_device(made).roll("kernel", substeps=100)
    assert apart(found.points.cpu(), expected.points) < 1e-11
    for name, gradient in slow.items():
        assert apart(fast[name].cpu(), gradient) < 1e-9, name


def test_the_stability_bound_and_a_fallback_that_is_none(scene, recwarn):
    made = on_device(scene())
    with torch.no_grad():
        found = made.simulator.rollout(made.state(), made.controls.to("cuda"))
    assert found.substeps == scene().simulator.rollout(scene().state(), scene().controls).substeps
    assert not recwarn.list
