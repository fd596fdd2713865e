"""A diagnosis with all that it was made of, for whoever writes it down."""

import warnings
from dataclasses import dataclass
from pathlib import Path

from model.bundle import TwinBundle
from model.gap.diagnosis import Diagnosis
from model.gap.plain import PlainTwin
from model.gap.report.statement import stated
from model.gap.schema import GapReport
from model.gap.taken import Taken
from model.gap.write_back import cannot_act, twin_of, with_findings
from model.types import Observation


@dataclass(frozen=True)
class DiagnosisResult:
    """What was diagnosed, and what was found."""

    diagnosis: Diagnosis
    observation: Observation
    plain: PlainTwin
    """The twin that the observation was compared with."""
    bundle: TwinBundle | None = None
    """The twin that was given, if one was."""
    taken: Taken | None = None
    """What of the recording was diagnosed; None: all of it."""

    @property
    def report(self) -> GapReport:
        """The gap report on the recording, its verdict stated."""
        found = stated(self.diagnosis.findings.report)
        return found if self.taken is None else self.taken.report(found)

    def write_report(self, folder: Path) -> tuple[Path, ...]:
        """Write the report and its figures; see `model.gap.report.write`."""
        from model.gap.report.write import write_report  # draws with matplotlib, which takes a second

        return write_report(self.diagnosis.findings, folder, self.report)

    def twin(self) -> TwinBundle | None:
        """The twin with what was found, or one made of the observation.

        None: nothing to carry was found, or what was cannot act in the twin, as a late hand where it has
        none; a warning says so.
        """
        if not self.diagnosis.effects:
            return None
        if self.bundle is None:
            made = twin_of(self.observation, self.diagnosis, self.plain)
        else:
            made = with_findings(self.bundle, self.observation, self.diagnosis)
        why = cannot_act(made)
        if why is not None:
            warnings.warn(f"no twin was written: what was found cannot act in it: {why}", stacklevel=2)
            return None
        return made
