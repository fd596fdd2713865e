"""Compiled kernels on a device, launched through the CUDA driver."""

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Protocol

import torch

from model.simulator.kernel.build import CannotBuild
from model.simulator.kernel.cuda.compiler import compile_text

BLOCK = 64
"""Threads of a block: few, so that a scene of some thousand points reaches all processors."""
KERNELS = ("forward_corners", "forward_points", "backward_end", "backward_corners", "backward_points")
MOST = 4096
"""Bytes that a launch may be told."""
WIDEST = 65535
"""Elements of a batch in one launch."""


class Launch(Protocol):
    """Runs a kernel for each of `threads` and each element of a batch."""

    def __call__(self, kernel: str, threads: int, batch: int, frame: ctypes.Structure, step: int) -> None:
        """Put it on the stream."""


class CudaError(RuntimeError):
    """The driver refuses a call."""


class Module:
    """Kernels on one device, in the context that torch has there.

    Args:
        driver: The CUDA driver.
        image: What `compile_text` gives.
        device: Which.

    Raises:
        CudaError: the driver refuses.
    """

    def __init__(self, driver: ctypes.CDLL, image: bytes, device: torch.device) -> None:
        """See the class."""
        self._driver, self._device = driver, device
        self._context, number, module = ctypes.c_void_p(), ctypes.c_int(), ctypes.c_void_p()
        self._ask("cuInit", 0)
        self._ask("cuDeviceGet", ctypes.byref(number), device.index or 0)
        self._ask("cuDevicePrimaryCtxRetain", ctypes.byref(self._context), number)
        self._kernels: dict[str, ctypes.c_void_p] = {}
        with self._current():
            self._ask("cuModuleLoadData", ctypes.byref(module), image)
            for name in KERNELS:
                self._kernels[name] = ctypes.c_void_p()
                self._ask("cuModuleGetFunction", ctypes.byref(self._kernels[name]), module, name.encode())

    @contextmanager
    def launching(self) -> Iterator[Launch]:
        """Launch kernels on the stream that torch is on.

        Raises:
            CudaError: the driver refuses a launch.
        """
        on = self._device.type == "cuda"
        stream = ctypes.c_void_p(torch.cuda.current_stream(self._device).cuda_stream if on else None)
        number, told = ctypes.c_int(), (ctypes.c_void_p * 2)()
        told[1] = ctypes.addressof(number)
        one, block, none = ctypes.c_uint(1), ctypes.c_uint(BLOCK), ctypes.c_uint(0)

        def launch(kernel: str, threads: int, batch: int, frame: ctypes.Structure, step: int) -> None:
            # the driver copies what it is told before it returns
            told[0], number.value = ctypes.addressof(frame), step
            grid = ctypes.c_uint(-(-threads // BLOCK)), ctypes.c_uint(batch), one
            self._ask(
                "cuLaunchKernel", self._kernels[kernel], *grid, block, one, one, none, stream, told, None
            )

        with self._current():
            yield launch

    @contextmanager
    def _current(self) -> Iterator[None]:
        """With torch's context as that of this thread; the threads of autograd have none of their own."""
        before = ctypes.c_void_p()
        self._ask("cuCtxPushCurrent_v2", self._context)
        try:
            yield
        finally:
            self._ask("cuCtxPopCurrent_v2", ctypes.byref(before))

    def _ask(self, function: str, *arguments: object) -> None:
        result = getattr(self._driver, function)(*arguments)
        if result:
            said = ctypes.c_char_p()
            self._driver.cuGetErrorString(result, ctypes.byref(said))
            raise CudaError(f"{function} fails: {(said.value or b'unknown error').decode()}")


Loader = Callable[[str, torch.device], Module]
"""From CUDA text to its kernels on a device."""


@lru_cache(maxsize=64)
def load(source: str, device: torch.device) -> Module:
    """Compile and load kernels.

    Raises:
        CannotBuild: no NVRTC or driver, or one that refuses the text.
    """
    image = compile_text(source, torch.cuda.get_device_capability(device))
    try:
        return Module(ctypes.CDLL("libcuda.so.1"), image, device)
    except (OSError, CudaError) as error:
        raise CannotBuild(f"the CUDA driver does not take the kernel ({error})") from error
