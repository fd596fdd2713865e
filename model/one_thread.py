"""Work on one thread: of torch, and of the linear algebra under numpy and scipy."""

from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def one_thread() -> Iterator[None]:
    """Torch and BLAS keep to one thread: where others share the work, and where every bit is to be the same.

    Sums are rounded differently by another number of threads. And threads of OpenBLAS wait for each other by
    spinning: where a core is busy with something else, the many small matrices of a fit take a thousand times
    as long.
    """
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with threadpool_limits(1, "blas"):
            yield
    finally:
        torch.set_num_threads(before)
