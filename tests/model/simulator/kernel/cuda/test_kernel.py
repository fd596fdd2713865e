"""What is the CUDA kernel's own. That it says what the oracle says is tested with the processor's kernel."""

import ctypes
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest
import torch

from model.simulator.backend import choose_path
from model.simulator.dynamics import Dynamics
from model.simulator.forces.bending import Bending
from model.simulator.forces.spring import Spring
from model.simulator.forces.volume import Volume
from model.simulator.integrators.semi_implicit_euler import SemiImplicitEuler
from model.simulator.kernel.build import CannotBuild
from model.simulator.kernel.cuda.kernel import CudaKernel
from model.simulator.kernel.cuda.module import Module
from model.simulator.kernel.terms import Inexpressible
from model.simulator.simulator import Simulator
from model.simulator.stability import differentiate
from model.simulator.system import Anchors, State


@pytest.fixture
def kernel(serial):
    """Make the kernel of a simulator."""

    def build(simulator, batch=(), loader=serial):
        return CudaKernel(simulator.dynamics(), simulator.integrator, torch.Size(batch), loader)

    return build


def test_slopes_are_those_of_reverse_differentiation(scene, kernel, apart):
    made = scene()
    generator = torch.Generator().manual_seed(3)
    with torch.no_grad():
        state = made.state()
        anchors = Anchors(made.controls[0], 0.1 * made.controls[1])
        vector = torch.randn(state.positions.shape, generator=generator, dtype=torch.float64)
        found = kernel(made.simulator).slopes(state, anchors)(vector)
    expected = differentiate(made.simulator.dynamics(), state, anchors)(vector)
    assert all(apart(*pair) < 1e-12 for pair in zip(found, expected, strict=True))


def test_no_thread_depends_on_another(scene, serial_driver, monkeypatch):
    drivers = []

    def loader(source, device):
        drivers.append(serial_driver(source))
        return Module(drivers[-1], b"serial", device)

    monkeypatch.setattr("model.simulator.backend.Kernel", lambda *terms: CudaKernel(*terms, loader=loader))
    groups = torch.arange(60).reshape(15, 4)
    forces = [Volume(groups, 1e3, torch.full((15,), 1e-6)), Bending(groups[:, :3], 1e-5, 0.05, 1.0)]
    made = scene(batch=(2,), forces=forces)
    rollout, gradients = made.roll("kernel")
    order = ctypes.c_int.in_dll(drivers[0], "last_first")
    order.value = 1
    try:
        again, back = made.roll("kernel")
    finally:
        order.value = 0
    assert torch.equal(again.points, rollout.points)
    assert all(torch.equal(back[name], gradients[name]) for name in gradients)


def test_simulators_on_a_device_get_it(monkeypatch):
    dynamics, made = create_autospec(Dynamics, instance=True), create_autospec(CudaKernel, instance=True)
    dynamics.mass, dynamics.contacts = SimpleNamespace(device=torch.device("cuda", 1)), []
    monkeypatch.setattr("model.simulator.backend.CudaKernel", lambda *terms: made)
    path = choose_path("kernel", dynamics, SemiImplicitEuler(), torch.Size(()))
    path.slopes(State(torch.zeros(1, 3), torch.zeros(1, 3)), None)
    made.slopes.assert_called_once()


def test_what_a_launch_cannot_hold_is_said(scene, kernel):
    simulator = scene().simulator
    with pytest.raises(Inexpressible, match="so large a batch"):
        kernel(simulator, batch=(65536,))
    kinds = [type(f"Spring{i}", (Spring,), {"name": f"spring_{i}"}) for i in range(110)]
    many = [kind(torch.ones(260)) for kind in kinds]
    with pytest.raises(Inexpressible, match="so many terms"):
        kernel(Simulator(simulator.system, many))


def test_without_nvrtc_it_says_so(scene, kernel):
    def none(source, device):
        raise CannotBuild("there is no NVRTC")

    with pytest.raises(Inexpressible, match="there is no NVRTC"):
        kernel(scene().simulator, loader=none)


def test_other_numbers_are_refused(scene, kernel):
    with pytest.raises(Inexpressible, match=r"torch.bfloat16 on cpu"):
        kernel(scene(torch.bfloat16).simulator)
