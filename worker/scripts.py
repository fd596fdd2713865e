"""The transitions of a job as Lua: each runs inside Redis as one transaction."""

from functools import cache
from importlib.resources import files
from typing import Any, Final

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
)


class Scripts:
    """The scripts by name, sent to Redis when it does not know them (yet, or after a restart)."""

    def __init__(self, redis: "Redis") -> None:
        """Nothing is sent before the first call."""
        self._redis = redis
        self._scripts = {name: redis.register_script(_text(name)) for name in NAMES}

    def __call__(self, name: str, *arguments: str | int | float) -> Any:  # noqa: ANN401 - Lua's answer
        """Run one. A call whose answer got lost is sent again: every script gives the same answer then."""
        return self._scripts[name](args=list(arguments), client=self._redis)


@cache
def _text(name: str) -> str:
    folder = files("worker") / "lua"
    return (folder / "prelude.lua").read_text() + (folder / f"{name}.lua").read_text()
