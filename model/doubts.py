"""Doubts that work has about its result, kept until it is done."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def collect_doubts() -> Iterator[list[str]]:
    """Collect what the work warns its user of, for the end; warnings meant for developers are dropped."""
    doubts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", UserWarning)
        yield doubts
    doubts += [str(entry.message) for entry in caught]
