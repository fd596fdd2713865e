import asyncio
import contextlib
import logging
from types import SimpleNamespace

from service import companions
from service.companions import Companions


def test_a_worker_that_cannot_be_started_is_tried_again(monkeypatch, caplog):
    """As when there are too many processes for a moment."""
    started = []

    def start(self):
        started.append(self)
        if len(started) == 1:
            raise BlockingIOError(11, "Resource temporarily unavailable")
        return SimpleNamespace(poll=lambda: None, returncode=None)

    monkeypatch.setattr(Companions, "_start_worker", start)
    monkeypatch.setattr(companions, "PAUSE_SECONDS", 0.01)
    beside = Companions(SimpleNamespace(pid=1), {})

    async def some_time():
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(beside.keep(), 0.5)

    with caplog.at_level(logging.ERROR):
        asyncio.run(some_time())
    assert len(started) == 2
    assert "the worker cannot be started" in caplog.text
