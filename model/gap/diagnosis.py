"""What a diagnosis found: its report, and what of it can be written into a twin."""

from collections.abc import Mapping
from dataclasses import dataclass

from model.gap.account import Account
from model.gap.report.findings import Findings
from model.schema import EffectRecord


@dataclass(frozen=True)
class Diagnosis:
    """The result of `model.gap.diagnose.diagnose`."""

    findings: Findings
    """For the gap report and its figures."""
    effects: tuple[EffectRecord, ...] = ()
    """What the verdict adds to the twin (`model.gap.carried.record_of`); empty where it names no effect."""
    fitted: Mapping[str, float] | None = None
    """Values of the plain twin's own quantities, fitted together with `effects`, which belong to them; those
    of effects may be among them. None: as the twin came."""
    account: Account | None = None
    """What the verdict was made of."""
