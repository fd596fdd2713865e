"""What a diagnosis found: its report, and what of it can be written into a twin."""

from dataclasses import dataclass

from model.gap.report.findings import Findings
from model.gap.world import World
from model.schema import EffectRecord


@dataclass(frozen=True)
class Diagnosis:
    """The result of `model.gap.diagnose.diagnose`."""

    findings: Findings
    """For the gap report and its figures."""
    effects: tuple[EffectRecord, ...] = ()
    """What the verdict adds to the twin (`model.gap.carried.record_of`); empty where it names no effect."""
    fitted: World | None = None
    """The plain twin, without effects, at the parameters of its own that were fitted together with `effects`:
    `study.plain.at(values)`; an effect belongs to them. None: as the twin came."""
