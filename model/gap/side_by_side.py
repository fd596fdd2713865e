"""Independent parts of a diagnosis at once, each on its share of the cores.

The worlds of one fit fill a core's vectors and leave little for another; two fits fill two.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from threading import Lock
from typing import TypeVar

import torch

from model.simulator.kernel.threads import granted, kernel_threads

T = TypeVar("T")
R = TypeVar("R")


def side_by_side(
    work: Callable[[T], R], items: Sequence[T], done: Callable[[int], None] | None = None
) -> list[R]:
    """What `work` makes of each item, in their order: the same as one after the other.

    As many are at work as kernels are granted threads here (`kernel_threads`). Who is left at the end, or
    alone, has all of them.

    Args:
        work: Changes nothing that another item's work reads.
        items: What to work on.
        done: Called with how many are done, in the caller's thread.

    Raises:
        Exception: what `work` raises; whatever else is under way is abandoned.
    """
    cores, tell = granted(), done or (lambda count: None)
    if cores < 2 or len(items) < 2:
        results = list[R]()
        for item in items:
            results.append(work(item))
            tell(len(results))
        return results
    shares = _Shares(cores)

    def worked(item: T) -> R:
        with shares.taken(), kernel_threads(shares.each):
            return work(item)

    # whoever begins has as many threads of torch as there are cores; what is said for one is said for all of
    # those that its matrix products take, so none takes it back before all have ended
    before = torch.get_num_threads()
    with ThreadPoolExecutor(min(cores, len(items)), "diagnosis", torch.set_num_threads, (1,)) as pool:
        try:
            futures = [pool.submit(worked, item) for item in items]
            for count, future in enumerate(as_completed(futures), start=1):
                future.result()
                tell(count)
        except BaseException:
            shares.abandon()
            pool.shutdown(cancel_futures=True)
            raise
        finally:
            torch.set_num_threads(before)
        return [future.result() for future in futures]


class _Shares:
    """Of the cores, among those who are at work.

    Args:
        cores: There are.
    """

    def __init__(self, cores: int) -> None:
        """See the class."""
        self._cores, self._busy, self._abandoned, self._lock = cores, 0, False, Lock()

    @contextmanager
    def taken(self) -> Iterator[None]:
        """One more is at work inside."""
        with self._lock:
            self._busy += 1
        try:
            yield
        finally:
            with self._lock:
                self._busy -= 1

    def each(self) -> int:
        """Threads for the kernels of each who is at work.

        Raises:
            CancelledError: nobody waits for the results any more. Kernels ask in each frame, so that an
                interrupted diagnosis does not go on for a fit.
        """
        if self._abandoned:
            raise CancelledError
        return max(1, self._cores // max(1, self._busy))

    def abandon(self) -> None:
        """Let those at work end at their next frame."""
        self._abandoned = True
