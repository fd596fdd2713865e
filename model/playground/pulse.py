"""How fast simulated time passes."""

from collections import deque

WINDOW = 1.0
"""Over which the speed is measured [s]."""
BEHIND = 0.2
"""How far [s] frames may fall behind the clock before it waits for them."""
SLOW = 0.95
"""Below this share of real time the user is told."""


class Pulse:
    """Says when the next frame is due, and how fast the frames really come.

    Args:
        interval: Of a frame [s].
    """

    def __init__(self, interval: float) -> None:
        """See the class."""
        self._interval = interval
        self._done = deque[float]()
        self._due: float | None = None

    def wait(self, now: float) -> float:
        """Seconds until the next frame is due, at the time `now` [s]; 0 where frames are late."""
        return 0.0 if self._due is None else max(0.0, self._due - now)

    def beat(self, now: float) -> None:
        """A frame was done at `now` [s]."""
        due = now if self._due is None else self._due
        self._due = max(due, now - BEHIND) + self._interval
        self._done.append(now)
        while now - self._done[0] > WINDOW:
            self._done.popleft()

    def pause(self) -> None:
        """No frames are wanted for now."""
        self._due = None
        self._done.clear()

    @property
    def speed(self) -> float | None:
        """Simulated seconds per second; None while that is not known."""
        if len(self._done) < 2:
            return None
        return (len(self._done) - 1) * self._interval / (self._done[-1] - self._done[0])
