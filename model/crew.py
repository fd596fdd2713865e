"""Processes that share a long piece of work, and end with the one that began it."""

import os
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

from threadpoolctl import threadpool_limits

LOOK = 1.0
"""Between looks at whether the parent is still there [s]."""


def crew(workers: int) -> ProcessPoolExecutor:
    """A pool of fresh processes, each computing with one thread.

    They are spawned: a fork of a process that has used torch may hang. A process whose parent has gone, even
    by `kill -9`, ends within a second or two, whatever it is at.

    Args:
        workers: How many.
    """
    return ProcessPoolExecutor(
        workers, mp_context=get_context("spawn"), initializer=_begin, initargs=(os.getpid(),)
    )


def _begin(parent: int) -> None:
    if "OMP_NUM_THREADS" not in os.environ:
        # of torch, which is not imported yet, and of what the parent's main module has imported: a process
        # that is spawned does so as well, before it comes here
        os.environ["OMP_NUM_THREADS"] = "1"
        threadpool_limits(1, "blas")
    threading.Thread(target=_watch, args=(parent,), name="watch-parent", daemon=True).start()


def _watch(parent: int) -> None:
    """End this process when its parent has gone: what it computes has no reader any more."""
    while os.getppid() == parent:
        time.sleep(LOOK)
    os._exit(1)
