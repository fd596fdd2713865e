"""The tables of a run in its folder, and as a section of `docs/evaluation.md`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from model.evaluation.tables import Table, csv_text, markdown
from model.formats.files import replacing
from model.formats.page import Section
from model.gap.report.style import png

COMMAND = "evaluation"
"""In the markers of a section."""


@dataclass(frozen=True)
class Run:
    """What the page says of how its figures came about."""

    title: str
    command: str
    date: str
    data: str
    opinion: str
    objects: int
    clips: int
    """That were learned from."""
    weights: Mapping[str, str]
    """Digests of what predictors learned beforehand, by method."""


def write_folder(
    out: Path, run: Run, made: Sequence[Table], drawn: Mapping[str, tuple[str, Figure]]
) -> tuple[Path, ...]:
    """Write `tables.md`, `tables.csv` and the figures of a run into its folder."""
    tables = (markdown(table) for table in made)
    text = "\n".join([f"# {run.title}\n", f"{_about(run)}\n", _how(run), *tables])
    contents = {"tables.md": text.encode(), "tables.csv": csv_text(made).encode()}
    contents |= {name: png(figure) for name, (_, figure) in drawn.items()}
    for name, content in contents.items():
        with replacing(out / name) as temporary:
            temporary.write_bytes(content)
    return tuple(out / name for name in contents)


def section(run: Run, made: Sequence[Table], drawn: Mapping[str, tuple[str, Figure]]) -> Section:
    """What a page says of a run: its tables, and its figures below."""
    figures = {name: (caption, png(figure)) for name, (caption, figure) in drawn.items()}
    body = "\n".join([_how(run), *(markdown(table) for table in made)])
    return Section(COMMAND, run.title, _about(run), body, figures)


def _about(run: Run) -> str:
    told = {
        "given": "as the cases say",
        "right": "peaked on the true material",
        "uniform": "every material as likely",
        "wrong": "peaked, on a wrong material in three parts of ten",
    }[run.opinion]
    return f"{run.objects} objects and {run.clips} clips of `{run.data}`, priors {told}; {run.date}."


def _how(run: Run) -> str:
    of = ", ".join(f"`{name}` {digest}" for name, digest in run.weights.items())
    weights = f"Weights (SHA-256): {of}. " if of else ""
    means = (
        "Means over objects with 95 % intervals (bootstrap over objects). Figures of parts are of all parts "
        "of the drawn objects, errors of global parameters root mean squares, and intervals of the spread of "
        "ln E are of a jackknife over objects."
    )
    return f"```\n{run.command}\n```\n\n{weights}{means}\n"
