"""Kernels are loaded and launched as the driver wants it, and what it refuses is said."""

import ctypes
import re

import pytest
import torch

from model.simulator.kernel.cuda.emit import kernel_source
from model.simulator.kernel.cuda.frame import fill, frame_type
from model.simulator.kernel.cuda.kernel import CudaKernel
from model.simulator.kernel.cuda.module import BLOCK, CudaError, Module

CPU = torch.device("cpu")


@pytest.fixture
def driver(serial_driver):
    """Of kernels without laws."""
    return serial_driver(kernel_source({}, [], False, torch.float64))


def test_both_sides_agree_on_what_a_launch_is_told(scene, serial, serial_driver):
    sources = []

    def keep(source, device):
        sources.append(source)
        return serial(source, device)

    made = scene()
    CudaKernel(made.simulator.dynamics(), made.simulator.integrator, torch.Size(()), keep)
    names = ("EDGES", "SCENES", "MEMORIES", "STENCILS")
    sizes = [int(re.search(rf"#define {name} (\d+)", sources[0])[1]) for name in names]
    assert min(sizes[:2]) > 1
    assert serial_driver(sources[0]).size_of_frame() == ctypes.sizeof(frame_type(*sizes))


def test_a_launch_runs_every_point_of_every_element(driver):
    count, batch = BLOCK + 3, 2
    start = torch.randn(batch, 1, count, 8, dtype=torch.float64)
    rows = torch.cat([start, torch.full_like(start, torch.nan)], 1)
    none = torch.zeros(count, dtype=torch.int32)
    frame = frame_type(0, 0, 0, 0)()
    frame.points, frame.ring, frame.count, frame.dt, frame.interval = count, 2, 1, 0.5, 0.5
    for slots in (frame.springs, frame.held):
        slots.start = slots.degree = slots.other = none.data_ptr()
    gravity, half = torch.tensor([[1.0, 2.0, 3.0]]).double(), torch.full((1, count), 0.5).double()
    fill(frame, {"rows": rows, "gravity": gravity, "inverse_mass": half, "factor": half}, batch)
    with Module(driver, b"serial", CPU).launching() as launch:
        launch("forward_points", count, batch, frame, 0)
    velocities = 0.5 * (start[:, 0, :, 3:6] + 0.5 * gravity)
    assert torch.equal(rows[:, 1, :, 3:6], velocities)
    assert torch.equal(rows[:, 1, :, :3], start[:, 0, :, :3] + 0.5 * velocities)


def test_an_image_that_the_driver_refuses_is_said(driver):
    with pytest.raises(CudaError, match="cuModuleLoadData fails: invalid value"):
        Module(driver, b"nonsense", CPU)


def test_a_launch_that_the_driver_refuses_is_said(driver):
    module = Module(driver, b"serial", CPU)
    with (
        pytest.raises(CudaError, match="cuLaunchKernel fails: invalid value"),
        module.launching() as launch,
    ):
        launch("forward_points", 5, 0, frame_type(0, 0, 0, 0)(), 0)


def test_the_context_of_the_thread_is_left_as_it_was(driver):
    module = Module(driver, b"serial", CPU)
    with pytest.raises(RuntimeError, match="in between"), module.launching():
        raise RuntimeError("in between")
    popped = ctypes.c_void_p()
    assert driver.cuCtxPopCurrent_v2(ctypes.byref(popped)) == 201, "a context stayed behind"
    driver.cuCtxPushCurrent_v2(popped)
