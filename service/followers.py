"""How many streams of events are open, and how many may be."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from service.errors import ProblemError

MOST: Final = 500
"""Of one front: each holds a connection to Redis."""
MOST_OF_ONE_KEY: Final = 50
WAIT_SECONDS: Final = 10


class Followers:
    """The streams of one front, counted on its event loop."""

    def __init__(self) -> None:
        """None is open."""
        self._open: Counter[str] = Counter()

    @contextmanager
    def one(self, key_id: str) -> Iterator[None]:
        """Count a stream of a key while it is open."""
        self._open[key_id] += 1
        try:
            yield
        finally:
            self._open[key_id] -= 1
            if not self._open[key_id]:
                del self._open[key_id]

    def check(self, key_id: str) -> None:
        """Refuse one stream too many.

        Raises:
            ProblemError: the key has too many, or the front has.
        """
        if self._open[key_id] >= MOST_OF_ONE_KEY:
            detail = f"at most {MOST_OF_ONE_KEY} streams of events may be open"
            raise ProblemError("too-many-requests", detail, retry_after=WAIT_SECONDS)
        if self._open.total() >= MOST:
            raise ProblemError("unavailable", "too many streams of events are open", retry_after=WAIT_SECONDS)
