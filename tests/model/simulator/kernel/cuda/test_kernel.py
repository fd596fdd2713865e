"""What is the CUDA kernel's own. That it says what the oracle says is tested with the processor's kernel."""

import pytest
import torch

from model.simulator.forces.spring import Spring
from model.simulator.kernel.build import CannotBuild
from model.simulator.kernel.cuda.kernel import CudaKernel
from model.simulator.kernel.terms import Inexpressible
from model.simulator.simulator import Simulator
from model.simulator.stability import differentiate
from model.simulator.system import Anchors


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


@pytest.mark.usefixtures("engine")
def test_the_same_run_gives_the_same_numbers(scene):
    made = scene(torch.float32)
    first, second = (made.roll("kernel") for _ in range(2))
    assert torch.equal(first[0].points, second[0].points)
    assert all(torch.equal(first[1][name], second[1][name]) for name in first[1])


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
