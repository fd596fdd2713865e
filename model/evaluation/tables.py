"""Records → tables: a figure with its interval per method, setting and metric, as Markdown and as CSV."""

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from model.evaluation.bootstrap import Interval, interval, mean_difference, mean_interval
from model.evaluation.consistency import consistency
from model.evaluation.protocol import GLOBALS, Setting
from model.evaluation.records import Record, Scores
from model.evaluation.truth import global_coverage, rank_lost, truth_scores


@dataclass(frozen=True)
class Metric:
    """How a score is shown."""

    key: str
    head: str
    factor: float = 1.0
    digits: int = 1


METRICS = (
    Metric("chamfer", "CD [mm]", 1e3),
    Metric("track", "track [mm]", 1e3),
    Metric("matched", "track, matched [mm]", 1e3),
    Metric("iou", "IoU [%]", 1e2),
    Metric("psnr", "PSNR [dB]"),
    Metric("psnr_object", "PSNR, object [dB]"),
    Metric("ssim", "SSIM", 1.0, 3),
    Metric("lpips", "LPIPS", 1.0, 3),
)
COMPARED = METRICS[:2]
PARTS = "parts: error of ln E"
RANK = "parts: rank correlation"
TITLES = {
    "reconstruction": "Reconstruction and resimulation",
    "future": "Future (7:3 in time)",
    "unseen_interaction": "Unseen interaction",
    "unseen_object": "Unseen object",
}


@dataclass(frozen=True)
class Cell:
    """One figure."""

    table: str
    method: str
    column: str
    figure: Interval | None
    digits: int = 1


@dataclass(frozen=True)
class Table:
    """A table of figures: rows are methods."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, tuple[Cell, ...], tuple[str, ...]], ...]
    """Method, figures, and what stands behind them."""
    more: tuple[str, ...] = ()
    """Heads of what stands behind the figures."""


def tables(records: Sequence[Record], methods: Sequence[str], settings: Sequence[Setting]) -> list[Table]:
    """All tables of some records.

    Args:
        records: Of all methods.
        methods: In this order; the others are compared with the first.
        settings: Which of them are shown.
    """
    of = {name: [record for record in records if record.method == name] for name in methods}
    made = [_setting(of, setting) for setting in settings]
    made += [
        _differences(of, settings),
        *(_classes(of, setting) for setting in settings if setting in _BY_CLASS),
    ]
    made += [
        _parts(of),
        _globals(of, "RMS error of the logarithm", _global_error),
        _globals(of, "share of truths in the stated 90 % interval", global_coverage),
        _consistency(of),
        _cost(of),
    ]
    return [table for table in made if any(cell.figure for _, cells, _ in table.rows for cell in cells)]


def markdown(table: Table) -> str:
    """The table under its title."""
    heads = ["method", *table.columns, *table.more]
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for method, cells, behind in table.rows:
        lines.append("| " + " | ".join([method, *(shown(cell) for cell in cells), *behind]) + " |")
    return f"### {table.title}\n\n" + "\n".join(lines) + "\n"


def as_plain(made: Iterable[Table]) -> list[dict[str, Any]]:
    """All figures, one per entry."""
    return [
        {"table": table.title, "method": name, "column": cell.column, **asdict(cell.figure)}
        for table in made
        for name, cells, _ in table.rows
        for cell in cells
        if cell.figure is not None
    ]


def csv_text(made: Iterable[Table]) -> str:
    """All figures, one per line."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    heads = ("table", "method", "column", "value", "low", "high", "objects")
    writer.writerow(heads)
    for entry in as_plain(made):
        known = (name for name in ("value", "low", "high") if entry[name] is not None)
        numbers = {name: f"{entry[name]:.6g}" for name in known}
        writer.writerow([(entry | numbers)[head] for head in heads])
    return buffer.getvalue()


def shown(cell: Cell) -> str:
    """Value and interval, or a dash."""
    return "–" if cell.figure is None else cell.figure.shown(cell.digits)


def scores_of(record: Record, setting: Setting) -> dict[str, Scores]:
    """The scores of a record in a setting, by case."""
    if setting == "unseen_interaction":
        return {each.case: each.scores for each in record.unseen}
    if setting == "reconstruction":
        return {record.case: record.reconstruction}
    if setting == "unseen_object" and record.known_object:
        return {}
    return {record.case: record.future}


def values(records: Iterable[Record], setting: Setting, metric: str) -> dict[tuple[str, str], float]:
    """A metric by object and clip (what was seen → what was predicted)."""
    found = {}
    for record in records:
        for case, scores in scores_of(record, setting).items():
            if metric in scores:
                found[record.thing, f"{record.case} → {case}"] = scores[metric]
    return found


def by_object(single: dict[tuple[str, str], float]) -> dict[str, list[float]]:
    """Values of each object."""
    groups: dict[str, list[float]] = {}
    for (name, _), value in single.items():
        groups.setdefault(name, []).append(value)
    return groups


_BY_CLASS = ("future", "unseen_interaction")


def _mean(records: Iterable[Record], setting: Setting, metric: Metric) -> Interval | None:
    figure = mean_interval(by_object(values(records, setting, metric.key)))
    return None if figure is None else figure.scaled(metric.factor)


def _setting(of: dict[str, list[Record]], setting: Setting) -> Table:
    title = TITLES[setting]
    there = [m for m in METRICS if any(values(records, setting, m.key) for records in of.values())]
    rows = []
    for name, records in of.items():
        cells = tuple(Cell(title, name, m.head, _mean(records, setting, m), m.digits) for m in there)
        single = values(records, setting, "track")
        failed = _failures(records, setting)
        rows.append((name, cells, (str(len(by_object(single))), str(len(single)), str(failed))))
    return Table(title, tuple(m.head for m in there), tuple(rows), ("objects", "clips", "failed"))


def _failures(records: Iterable[Record], setting: Setting) -> int:
    if setting == "unseen_interaction":
        return sum(each.failed is not None for record in records for each in record.unseen)
    counted = (record for record in records if scores_of(record, setting))
    return sum(record.failed is not None for record in counted)


def _differences(of: dict[str, list[Record]], settings: Sequence[Setting]) -> Table:
    first = next(iter(of))
    title = f"Worse than {first} by (paired; above 0: {first} is better)"
    pairs = [(setting, metric) for setting in settings for metric in COMPARED]
    columns = tuple(f"{setting.replace('_', ' ')}: {metric.head}" for setting, metric in pairs)
    rows = []
    for name in list(of)[1:]:
        cells = []
        for column, (setting, metric) in zip(columns, pairs, strict=True):
            ours, theirs = (values(of[each], setting, metric.key) for each in (first, name))
            figure = mean_difference(ours, theirs)
            cells.append(
                Cell(title, name, column, None if figure is None else figure.scaled(metric.factor), 2)
            )
        ours, theirs = (_part_errors(of[each]) for each in (first, name))
        cells.append(Cell(title, name, PARTS, mean_difference(ours, theirs), 2))
        cells.append(Cell(title, name, RANK, rank_lost(of[first], of[name]), 2))
        rows.append((name, tuple(cells), ()))
    return Table(title, (*columns, PARTS, RANK), tuple(rows))


def _part_errors(records: Iterable[Record]) -> dict[tuple[str, str], float]:
    """Mean distance of ln E from the truth over the parts, by object and clip."""
    found = {}
    for record in records:
        errors = [abs(p.log_estimate - p.log_truth) for p in record.parts if p.log_truth is not None]
        if errors:
            found[record.thing, record.case] = float(np.mean(errors))
    return found


def _classes(of: dict[str, list[Record]], setting: Setting) -> Table:
    title = f"{TITLES[setting]}: track error by class [mm]"
    classes = sorted({record.object_class for records in of.values() for record in records})
    rows = []
    for name, records in of.items():
        cells = tuple(
            Cell(
                title, name, kind, _mean([r for r in records if r.object_class == kind], setting, COMPARED[1])
            )
            for kind in classes
        )
        rows.append((name, cells, ()))
    return Table(title, tuple(classes), tuple(rows))


def _parts(of: dict[str, list[Record]]) -> Table:
    title = "Stiffness of the parts against the truth"
    columns = ("rank correlation", "RMS error of ln E", "bias of ln E", "90 % interval covers")
    rows = []
    for name, records in of.items():
        scores = truth_scores(records)
        figures = (scores.rank, scores.error, scores.bias, scores.coverage)
        cells = tuple(Cell(title, name, c, f, 2) for c, f in zip(columns, figures, strict=True))
        rows.append((name, cells, (str(scores.parts),)))
    return Table(title, columns, tuple(rows), ("parts",))


def _globals(
    of: dict[str, list[Record]], what: str, figure: Callable[[list[Record], str], Interval | None]
) -> Table:
    title = f"Parameters of the whole object: {what}"
    rows = []
    for name, records in of.items():
        cells = tuple(Cell(title, name, each, figure(records, each), 2) for each in GLOBALS)
        rows.append((name, cells, ()))
    return Table(title, GLOBALS, tuple(rows))


def _global_error(records: Iterable[Record], name: str) -> Interval | None:
    groups: dict[str, list[float]] = {}
    for record in records:
        if name in record.globals:
            entry = record.globals[name]
            ratio = max(entry.estimate, 1e-6) / max(entry.truth, 1e-6)
            groups.setdefault(record.thing, []).append(float(np.log(ratio)) ** 2)
    ordered = [groups[key] for key in sorted(groups)]
    return interval(ordered, lambda chosen: float(np.sqrt(np.mean([np.mean(each) for each in chosen]))))


def _consistency(of: dict[str, list[Record]]) -> Table:
    title = "Spread of ln E of the same material"
    columns = ("over scenes", "true moduli", "of the error, over scenes", "over interactions of an object")
    rows = []
    for name, records in of.items():
        found = consistency(records)
        figures = (
            found.over_scenes,
            found.truth_over_scenes,
            found.error_over_scenes,
            found.over_interactions,
        )
        cells = tuple(Cell(title, name, c, f, 2) for c, f in zip(columns, figures, strict=True))
        rows.append((name, cells, ()))
    return Table(title, columns, tuple(rows))


def _cost(of: dict[str, list[Record]]) -> Table:
    title = "Time per clip [s]"
    rows = []
    for name, records in of.items():
        fit = mean_interval(_seconds(records, "fit_seconds"))
        predict = mean_interval(_seconds(records, "predict_seconds"))
        rows.append(
            (name, (Cell(title, name, "learning", fit, 2), Cell(title, name, "predicting", predict, 2)), ())
        )
    return Table(title, ("learning", "predicting"), tuple(rows))


def _seconds(records: Iterable[Record], field: str) -> dict[str, list[float]]:
    """By object; what failed took no time that says anything."""
    groups: dict[str, list[float]] = {}
    for record in records:
        if record.failed is None:
            groups.setdefault(record.thing, []).append(float(getattr(record, field)))
    return groups
