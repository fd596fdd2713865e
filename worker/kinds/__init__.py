"""What the service can do, one kind of job per file."""

from collections.abc import Iterable

from worker.kinds.base import Input, Kind, Outcome, OutOfTimeError, Postponed, Run
from worker.kinds.diagnosis import DiagnosisKind
from worker.kinds.export import ExportKind
from worker.kinds.twin import TwinKind
from worker.kinds.webhook import WebhookKind

ALL_KINDS: tuple[Kind, ...] = (TwinKind(), ExportKind(), DiagnosisKind(), WebhookKind())

__all__ = ["ALL_KINDS", "Input", "Kind", "OutOfTimeError", "Outcome", "Postponed", "Run", "kind_called"]


def kind_called(name: str, kinds: Iterable[Kind] = ALL_KINDS) -> Kind:
    """The kind of that name.

    Raises:
        KeyError: there is none.
    """
    return {kind.name: kind for kind in kinds}[name]
