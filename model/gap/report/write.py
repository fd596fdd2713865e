"""A report in a folder: all of it, or none."""

from contextlib import ExitStack
from pathlib import Path

from model.formats.files import replacing
from model.gap.report.figures import ALL_DRAWINGS
from model.gap.report.findings import Findings
from model.gap.report.page import page
from model.gap.report.statement import stated
from model.gap.report.style import png
from model.gap.schema import GapReport
from model.schema import write_json

REPORT, PAGE = "report.json", "report.html"


def report_files(folder: Path) -> tuple[Path, ...]:
    """All that `write_report` writes, `report.json` first."""
    return tuple(folder / name for name in (REPORT, PAGE, *(each.file for each in ALL_DRAWINGS)))


def write_report(findings: Findings, folder: Path, whole: GapReport | None = None) -> tuple[Path, ...]:
    """Write `report.json`, `report.html` and the figures; other files of the folder stay.

    Whoever finds a `report.json` finds the page and the figures that belong to it: everything is drawn and on
    the disk before anything appears, an older `report.json` goes first, and the new one comes last.

    Args:
        findings: What was found; a verdict without a statement gets one.
        folder: Made if missing.
        whole: The report, where it speaks of more frames than the figures show; None: that of `findings`.

    Returns:
        What was written, `report.json` first.

    Raises:
        InputError: nothing can be written there.
    """
    report = stated(findings.report if whole is None else whole)
    images = {each.file: png(each.draw(findings)) for each in ALL_DRAWINGS}
    contents = {REPORT: write_json(report), PAGE: page(report, images).encode("utf-8"), **images}
    with ExitStack() as unwound:  # what is entered first, report.json, is put in place last
        for name, content in contents.items():
            unwound.enter_context(replacing(folder / name)).write_bytes(content)
        (folder / REPORT).unlink(missing_ok=True)
    return report_files(folder)
