"""How many threads a compiled kernel takes."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import torch

_granted: ContextVar[int | None] = ContextVar("kernel_threads", default=None)


@contextmanager
def kernel_threads(count: int) -> Iterator[None]:
    """Kernels that are called inside take up to `count` threads, however many torch has.

    A kernel gains from threads where torch's small operations lose by them, and computes the same bits with
    any number of them.
    """
    before = _granted.set(count)
    try:
        yield
    finally:
        _granted.reset(before)


def granted() -> int:
    """As many as torch, unless told otherwise."""
    count = _granted.get()
    return torch.get_num_threads() if count is None else count


def usable_cores() -> int:
    """Cores that this process may use; `OMP_NUM_THREADS` where it is set, since processes share them then."""
    asked = os.environ.get("OMP_NUM_THREADS", "")
    if asked.isdecimal():
        return max(1, int(asked))
    # a container or taskset may leave fewer than the machine has; not every system can say so
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
