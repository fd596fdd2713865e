"""What each stage did, kept for the manifest and told to whoever watches."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeVar, runtime_checkable

from model.schema import StageRecord

StageReport = Callable[[str, float], None]
"""Called with the stage that begins or goes on, and the share of the whole work done, 0..1."""

R = TypeVar("R")


@runtime_checkable
class Method(Protocol):
    """Anything a stage is done by."""

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def version(self) -> str: ...  # noqa: D102
    @property
    def weights(self) -> str | None: ...  # noqa: D102


@dataclass(frozen=True)
class Step:
    """A stage that is one function, with nothing to choose between."""

    name: str
    version: str
    weights: str | None = None


class StageLog:
    """Runs stages, times them, and keeps their records in order.

    Args:
        shares: The expected share of the whole time of every stage, in order; they need not sum to 1.
        report: Told at the beginning of each stage, and by stages that know how far they are.
    """

    def __init__(self, shares: dict[str, float], report: StageReport) -> None:
        """See the class."""
        total = sum(shares.values())
        self._shares = {name: share / total for name, share in shares.items()}
        self._report = report
        self._done = 0.0
        self.seconds: dict[str, float] = {}
        self.records: list[StageRecord] = []

    def run(self, stage: str, method: Method, work: Callable[[], R]) -> R:
        """Do `work` as `stage`; the warnings of its result go into the record."""
        self._report(stage, self._done)
        started = time.perf_counter()
        result = work()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - started
        self._done += self._shares[stage]
        warnings: tuple[str, ...] = getattr(result, "warnings", ())
        self.records.append(
            StageRecord(
                name=stage,
                method=method.name,
                version=method.version,
                weights=method.weights,
                seconds=None,
                warnings=warnings,
            )
        )
        return result

    def within(self, stage: str) -> Callable[[float], None]:
        """A function that reports the share of `stage` done, 0..1, while it runs."""
        return lambda share: self._report(stage, min(self._done + share * self._shares[stage], 1.0))

    @property
    def warnings(self) -> list[str]:
        """All warnings, in the order of the stages, each said once and with the stage it comes from."""
        said = {f"{record.name}: {warning}": None for record in self.records for warning in record.warnings}
        return list(said)
