"""What happened to all jobs so far, counted by the transitions in Redis: any front can tell it, whoever did it."""

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
        """How many jobs of a kind were accepted, succeeded, failed or canceled, and how many attempts crashed.

        The key is kind and outcome: `accepted`, `succeeded`, `failed`, `canceled`, `crashed`.
        """
        counts = cast("dict[str, str]", self._redis.hgetall("matphys:outcomes"))
        return {(kind, outcome): int(count) for (kind, outcome), count in _split(counts, 2)}

    def stages(self) -> Mapping[tuple[str, str], Durations]:
        """How long the stages of each kind took.

        The key is kind and stage; two stages are not the pipeline's: `queued`, from acceptance to the first
        attempt, and `total`, from acceptance to the end.
        """
        buckets: dict[tuple[str, str], dict[float, int]] = {}
        whole: dict[tuple[str, str], dict[str, float]] = {}
        fields = cast("dict[str, str]", self._redis.hgetall("matphys:stages"))
        for (kind, stage, what), value in _split(fields, 3):
            if what in ("count", "sum"):
                whole.setdefault((kind, stage), {})[what] = float(value)
            else:
                buckets.setdefault((kind, stage), {})[float(what)] = int(value)
        return {
            name: Durations(tuple(sorted(buckets.get(name, {}).items())), round(of["count"]), of["sum"])
            for name, of in whole.items()
        }


def _split(fields: Mapping[str, str], parts: int) -> list[tuple[tuple[str, ...], str]]:
    return [(tuple(name.split("|", parts - 1)), value) for name, value in fields.items()]
