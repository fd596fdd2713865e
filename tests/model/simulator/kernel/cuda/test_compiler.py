"""The text of a kernel with everything in it compiles for real devices, by NVRTC and by nvcc."""

import shutil
import subprocess

import pytest
import torch

from model.gap.effects.grip_slip import SlippingGrip
from model.gap.effects.viscoelasticity import MaxwellBranch
from model.simulator.forces.bending import Bending
from model.simulator.forces.volume import Volume
from model.simulator.kernel.build import CannotBuild
from model.simulator.kernel.cuda import compiler
from model.simulator.kernel.cuda.emit import TYPES
from model.simulator.kernel.cuda.kernel import CudaKernel
from model.simulator.kernel.cuda.module import KERNELS

NVCC = shutil.which("nvcc")


@pytest.fixture
def nvrtc():
    try:
        return compiler.find()
    except CannotBuild as error:
        pytest.skip(str(error))


@pytest.fixture
def source(scene, serial):
    """Make the text of springs, dashpots, grips that slip, the ground, bending and volumes."""

    def build(dtype):
        texts = []

        def keep(text, device):
            texts.append(text)
            return serial(text, device)

        made = scene(
            dtype, forces=[SlippingGrip(torch.ones(12), 1.0, 1.0), MaxwellBranch(1.0, 1.0, 1.0, 0.1)]
        )
        groups = torch.arange(8).reshape(2, 4)
        simulator = made.simulator.with_force(Volume(groups, 1.0, torch.ones(2)))
        simulator = simulator.with_force(Bending(groups[:, :3], 1.0, 0.1, 0.0))
        CudaKernel(simulator.dynamics(), simulator.integrator, torch.Size(()), keep)
        return texts[0]

    return build


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("target", ["compute_80", "sm_80", "sm_90"])
def test_nvrtc_takes_it(nvrtc, source, dtype, target):
    image = compiler.build(nvrtc, source(dtype), target)
    assert all(name.encode() in image for name in KERNELS)
    assert image.startswith(b"\x7fELF") == target.startswith("sm_")


@pytest.mark.skipif(NVCC is None, reason="there is no nvcc on the PATH")
@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("target", ["sm_80", "sm_90"])
def test_nvcc_takes_it_without_a_warning_and_spills_nothing(source, tmp_path, dtype, target):
    text, made = tmp_path / "kernel.cu", tmp_path / "kernel.cubin"
    text.write_text(source(dtype))
    options = ["-std=c++17", f"-arch={target}", "-cubin", "-Werror", "all-warnings", "-Xptxas", "-v"]
    run = subprocess.run([NVCC, *options, "-o", made, text], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert run.stderr.count("0 bytes spill stores, 0 bytes spill loads") == len(KERNELS), run.stderr


def test_a_device_gets_the_newest_that_it_can_run(nvrtc):
    assert compiler.target_of(nvrtc, (8, 0)) == "sm_80"
    assert compiler.target_of(nvrtc, (8, 5)) == "compute_80"
    with pytest.raises(CannotBuild, match="knows no device as old as sm_10"):
        compiler.target_of(nvrtc, (1, 0))


def test_a_text_that_nvrtc_refuses_is_said_in_one_line(nvrtc):
    with pytest.raises(CannotBuild, match=r"NVRTC refuses the kernel: kernel.cu\(1\): error: ") as caught:
        compiler.build(nvrtc, "this is not CUDA", "sm_80")
    assert "\n" not in str(caught.value)


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """NVRTC that counts what it builds, over an empty cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    built = []
    monkeypatch.setattr(compiler, "find", lambda: None)
    monkeypatch.setattr(compiler, "version", lambda library: "13.0")
    monkeypatch.setattr(compiler, "target_of", lambda library, known: f"sm_{known[0]}{known[1]}")
    monkeypatch.setattr(compiler, "build", lambda *told: built.append(told) or b"image %d" % len(built))
    return built


def test_a_text_is_compiled_once_for_each_kind_of_device(fake, tmp_path):
    first = compiler.compile_text("text", (9, 0))
    assert compiler.compile_text("text", (9, 0)) == first
    assert compiler.compile_text("text", (8, 0)) != first
    assert compiler.compile_text("other", (9, 0)) not in (first, b"image 2")
    assert len(fake) == 3
    assert len(list((tmp_path / "matphys" / "kernels").iterdir())) == 3, "something was left behind"


def test_without_nvrtc_it_says_what_to_install(monkeypatch):
    compiler.find.cache_clear()
    monkeypatch.setattr("sys.path", [])
    monkeypatch.setattr(compiler, "LIBRARIES", ("libnvrtc-of-nobody.so",))
    with pytest.raises(CannotBuild, match="install the package nvidia-cuda-nvrtc"):
        compiler.find()
