"""How many threads a compiled kernel takes."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeAlias

import torch

Count: TypeAlias = int | Callable[[], int]
"""A number, or what is asked for one in each frame."""

_granted: ContextVar[Count | None] = ContextVar("kernel_threads", default=None)


@contextmanager
def kernel_threads(count: Count) -> Iterator[None]:
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
    if count is None:
        return torch.get_num_threads()
    return count if isinstance(count, int) else count()


def usable_cores() -> int:
    """Cores that this process may use; `OMP_NUM_THREADS` where it is set, since processes share them then."""
    asked = os.environ.get("OMP_NUM_THREADS", "")
    if asked.isdecimal():
        return max(1, int(asked))
    # a container or taskset may leave fewer than the machine has; not every system can say so
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
