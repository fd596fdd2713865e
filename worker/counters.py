"""What happened to all jobs so far, counted by the transitions in Redis, so that any front can tell."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

from redis import Redis


@dataclass(frozen=True)
class Durations:
    """A histogram of seconds."""

    buckets: tuple[tuple[float, int], ...]
    """Upper bound [s] and how many took no longer, in order of the bounds."""
    count: int
    seconds: float
    """The sum [s]."""


class Counters:
    """Counts since the first job.

    Args:
        redis: As `worker.queues.connect` makes it.
    """

    def __init__(self, redis: "Redis") -> None:
        """See the class."""
        self._redis = redis

    def outcomes(self) -> Mapping[tuple[str, str], int]:
        """How many jobs of a kind were accepted and how they ended, and how many attempts crashed.

        The key is kind and outcome: `accepted`, `succeeded`, `failed`, `canceled`, `crashed`.
        """
        counts = cast("dict[str, str]", self._redis.hgetall("matphys:outcomes"))
        return {_pair(name): int(count) for name, count in counts.items()}

    def stages(self) -> Mapping[tuple[str, str], Durations]:
        """How long the stages of each kind took.

        The key is kind and stage; two stages are not the pipeline's: `queued`, from acceptance to the first
        attempt, and `total`, from acceptance to the end.
        """
        buckets: dict[tuple[str, str], dict[float, int]] = {}
        whole: dict[tuple[str, str], dict[str, float]] = {}
        fields = cast("dict[str, str]", self._redis.hgetall("matphys:stages"))
        for field, value in fields.items():
            name, _, what = field.rpartition("|")
            if what in ("count", "sum"):
                whole.setdefault(_pair(name), {})[what] = float(value)
            else:
                buckets.setdefault(_pair(name), {})[float(what)] = int(value)
        return {
            name: Durations(tuple(sorted(buckets.get(name, {}).items())), round(of["count"]), of["sum"])
            for name, of in whole.items()
        }


def _pair(name: str) -> tuple[str, str]:
    first, _, second = name.partition("|")
    return first, second
