"""The transitions of a job as Lua: each runs inside Redis as one transaction."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.resources import files
from typing import Any, Final

import redis.exceptions
from redis import Redis

NAMES: Final = (
    "create",
    "begin",
    "advance",
    "renew",
    "succeed",
    "fail",
    "release",
    "reap",
    "cancel",
    "delete",
    "expire",
    "log",
)


SYNC_MS: Final = 5000
"""How long a disk may take [ms]."""


class Scripts:
    """The scripts by name, sent to Redis when it does not know them (yet, or after a restart)."""

    def __init__(self, client: "Redis") -> None:
        """Nothing is sent before the first call."""
        self._redis, self._tells = client, True
        self._scripts = {name: client.register_script(_text(name)) for name in NAMES}

    def __call__(self, name: str, *arguments: str | int | float) -> Any:  # noqa: ANN401 - Lua's answer
        """Run one. A call whose answer got lost is sent again: every script gives the same answer then."""
        return self._scripts[name](args=list(arguments), client=self._redis)

    def settled(self, name: str, *arguments: str | int | float) -> Any:  # noqa: ANN401 - Lua's answer
        """Run one, and wait until what it wrote is on disk: see `settling`.

        Raises:
            redis.exceptions.TimeoutError: the disk did not take it in time.
        """
        with self.settling() as run:
            return run(name, *arguments)

    @contextmanager
    def settling(self) -> Iterator[Callable[..., Any]]:
        """Run some, and wait until what they wrote is on disk, where Redis can tell (WAITAOF, 7.2).

        To wait after each would take a second of each where the file is synced every second. Without that,
        an append-only file that is synced every second loses nothing when Redis is killed (the
        kernel has the bytes), and up to a second when the machine loses power.

        Raises:
            redis.exceptions.TimeoutError: the disk did not take it in time.
        """
        if not self._tells:
            yield self
            return
        # WAITAOF is about the writes of its own connection.
        with self._redis.client() as one:  # type: ignore[no-untyped-call]
            yield lambda name, *arguments: self._scripts[name](args=list(arguments), client=one)
            try:
                synced, _ = one.waitaof(1, 0, SYNC_MS)
            except redis.exceptions.ResponseError:  # an older Redis, or one that appends to no file
                self._tells = False
                return
        if synced < 1:
            raise redis.exceptions.TimeoutError("the disk of Redis is too slow")


@cache
def _text(name: str) -> str:
    folder = files("worker") / "lua"
    return (folder / "prelude.lua").read_text() + (folder / f"{name}.lua").read_text()
