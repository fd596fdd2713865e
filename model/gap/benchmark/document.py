"""The table of a run as text and as a section of `docs/gap-benchmark.md`."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from model.formats.page import Section
from model.gap.benchmark import figures
from model.gap.benchmark.outcomes import Outcome
from model.gap.benchmark.scores import Score, confusion
from model.gap.benchmark.table import Row, Table
from model.gap.report.style import png

COMMAND = "gap-benchmark"
"""That writes the section."""
HEAD = """# The withheld check

How well `matphys diagnose` does on worlds whose truth it was not told: simulated by code that shares
nothing with our simulator (`benchmarks/reality/`), and diagnosed before their labels were read. `matphys
gap-benchmark` diagnoses a folder of worlds, writes `predictions.json`, hashes it, opens the labels and
writes its section of this page.

A *world* is two recordings of one simulated object, in two interactions, of which it is known what the
twin of such an object lacks. *Healthy*: nothing. *Clear*: an effect of the catalogue that leaves twice
as much as noise and discretisation, or more, after a plain twin was refitted. *Unknown*: something that
is not in the catalogue. The *plain twin* is the one without any effect. *ECE* is the expected
calibration error, *AUC* the area under the receiver's curve.

"""
NOTES = """\
Intervals are 95 %: Wilson's for shares of worlds, percentile bootstrap over worlds otherwise. A diagnosis
that is refused or breaks counts as wrong. *Signal-to-noise* is the gap that a refit of the base leaves, over
noise and discretisation. A world with two effects counts as right when the first named is one of them.
*Where* compares `where.acts_on` with the label, each cut at half of its greatest value, for effects that act
on a part of the object; a wrong verdict counts with what it says. *Gap closed* is over all worlds together,
of the interaction that the diagnosis was given as transfer. *Cover*: actuation delay, direction of gravity,
share of slackness, excess mass and static friction, where rightly named; other quantities mean different
things in different laws. *ECE by chance* is what a judge whose probabilities are right has on as many worlds,
and where 95 % of such judges are. *Asked* is what this project has set itself, *good* and *astonishing* are
further marks. Where more than one answer is right, the truth is taken to be the one that was given, if it is.
"""


@dataclass(frozen=True)
class Run:
    """What a section says of how it came about."""

    title: str
    command: str
    date: str
    folder: str
    digest: str
    """SHA-256 of the predictions."""
    seconds: float
    """Of one diagnosis, at the median; 0 where nobody took the time."""


def printed(run: Run, table: Table) -> str:
    """The table for a terminal."""
    lines = [f"{run.title}: predictions {run.digest[:16]}"]
    for row in (*table.rows, *table.kinds):
        lines.append(f"{row.name:<44} {_figure(row.score):<24} {_bar(row):<9} {_mark(row):<12} {row.of}")
    for rung in table.ladder:
        named, noticed = _figure(rung.named), _figure(rung.noticed)
        lines.append(f"magnitude {rung.magnitude:<4g} named {named:<24} noticed {noticed}")
    return "\n".join(lines)


def section(run: Run, table: Table, worlds: Sequence[Outcome]) -> Section:
    """What a page says of a run: its tables, and its figures below."""
    clear = [each for each in worlds if each.clear]
    drawn = {"detectability.png": ("How small an effect may be", figures.detectability(table))}
    if clear:
        drawn |= {
            "confusion.png": ("Verdicts by truth", figures.matrix(clear)),
            "calibration.png": ("What a probability is worth", figures.calibration(clear)),
        }
    body = [
        f"```\n{run.command}\n```",
        _scores(table.rows),
        NOTES.strip(),
        _ladder(table),
        *([_scores(table.kinds)] if table.kinds else []),
        _mistakes(clear),
    ]
    images = {name: (caption, png(figure)) for name, (caption, figure) in drawn.items()}
    return Section(COMMAND, run.title, _about(run, worlds), "\n\n".join(body), images)


def _about(run: Run, worlds: Sequence[Outcome]) -> str:
    counts = Counter(each.category for each in worlds)
    made = ", ".join(f"{count} {name}" for name, count in sorted(counts.items()))
    pace = f" One diagnosis took {run.seconds:.0f} s at the median." if run.seconds else ""
    told = f"{len(worlds)} worlds of `{run.folder}` ({made}), {run.date}. Predictions `{run.digest[:16]}`."
    return told + pace


def _scores(rows: Sequence[Row]) -> str:
    lines = [
        "| score | of | value | n | asked | holds | good | astonishing |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        bars = " | ".join(_bound(value, row.bars.smaller) for value in (row.bars.good, row.bars.astonishing))
        lines.append(
            f"| {row.name} | {row.of} | {_figure(row.score)} | {row.score.count} | {_bar(row)} | {_mark(row)}"
            f" | {bars} |"
        )
    return "\n".join(lines)


def _ladder(table: Table) -> str:
    lines = ["| signal-to-noise near | rightly named | something missing | n |", "|---|---|---|---|"]
    for rung in table.ladder:
        named, noticed = _figure(rung.named), _figure(rung.noticed)
        lines.append(f"| {rung.magnitude:g} | {named} | {noticed} | {rung.named.count} |")
    return "\n".join(lines)


def _mistakes(worlds: Sequence[Outcome]) -> str:
    """The confusion matrix in words: every truth with its verdicts."""
    classes = figures.classes_of(worlds)
    counts = confusion([each.truth for each in worlds], [each.answer for each in worlds], classes)
    lines = ["| truth | verdicts, no effect or a clear one |", "|---|---|"]
    for name, row in zip(classes, counts, strict=True):
        said = sorted(
            ((count, other) for count, other in zip(row, classes, strict=True) if count), reverse=True
        )
        if said:
            lines.append(f"| {name} | " + ", ".join(f"{other} {count}" for count, other in said) + " |")
    return "\n".join(lines)


def _figure(score: Score) -> str:
    if score.value is None:
        return "–"
    return f"{score.value:.3f} [{score.low:.3f}, {score.high:.3f}]"


def _bar(row: Row) -> str:
    if row.bars.most is not None:
        return f"{row.bars.asked:g}–{row.bars.most:g}"
    return _bound(row.bars.asked, row.bars.smaller)


def _bound(value: float | None, smaller: bool) -> str:
    return "" if value is None else f"{'≤' if smaller else '≥'} {value:g}"


def _mark(row: Row) -> str:
    return {True: "holds", False: "falls short", None: ""}[row.holds]
