"""What a twin lacks of what really moved."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from model.bundle import TwinBundle
from model.doubts import collect_doubts
from model.gap.diagnosis import Diagnosis
from model.gap.given import given_twin
from model.gap.guessed_twin import guessed_twin
from model.gap.registration import moved_alike
from model.gap.result import DiagnosisResult
from model.gap.taken import Taken
from model.observation import read_observation
from model.one_thread import one_thread
from model.stage_log import StageReport


def diagnose(
    observation: Path, twin: Path | None, transfer: Path | None, report: StageReport
) -> DiagnosisResult:
    """Say where a twin departs from what really moved, which effect it lacks, and how far the gap shrinks.

    Args:
        observation: What really moved.
        twin: What it is compared with; None: a plain twin made of the observation.
        transfer: A second interaction with the same object.
        report: Told which stage begins and how far the whole is.

    Raises:
        InputError: a file cannot be used, or they do not belong together; the message is one line.
    """
    from model.gap.diagnose import diagnose as find  # with a trained jury, which building a twin does without

    report("observation", 0.0)
    with collect_doubts() as doubts:
        taken = Taken.of(read_observation(observation), observation.name)
        seen = taken.observation
        other = None if transfer is None else taken.other(read_observation(transfer), transfer.name)
        bundle = None if twin is None else TwinBundle.load(twin)
        with one_thread():
            plain = guessed_twin(seen, other) if bundle is None else given_twin(bundle, seen)
        if bundle is not None and other is not None:
            other = moved_alike(other, seen, plain.observation)
        found = find(plain.observation, plain, other, report)
    report("done", 1.0)
    return DiagnosisResult(_doubted(found, doubts), plain.observation, plain, bundle, taken)


def _doubted(found: Diagnosis, doubts: Sequence[str]) -> Diagnosis:
    """The diagnosis with what its input gave reason to doubt among the warnings of its report."""
    report = found.findings.report
    said = tuple(dict.fromkeys([*report.warnings, *doubts]))
    findings = replace(found.findings, report=report.model_copy(update={"warnings": said}))
    return replace(found, findings=findings)
