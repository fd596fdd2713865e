"""The tables of a run in its folder, and between markers in `docs/evaluation.md`."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from model.errors import InputError
from model.evaluation.tables import Table, csv_text, markdown
from model.formats.files import replacing
from model.gap.report.style import png

START, END = "<!-- evaluation: {} -->", "<!-- end of evaluation: {} -->"
"""Around what a run of this title has written."""


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


def write_folder(
    out: Path, run: Run, made: Sequence[Table], drawn: Mapping[str, tuple[str, Figure]]
) -> tuple[Path, ...]:
    """Write `tables.md`, `tables.csv` and the figures of a run into its folder."""
    text = "\n".join([f"# {run.title}\n", _about(run), *(markdown(table) for table in made)])
    contents = {"tables.md": text.encode(), "tables.csv": csv_text(made).encode()}
    contents |= {name: png(figure) for name, (_, figure) in drawn.items()}
    for name, content in contents.items():
        with replacing(out / name) as temporary:
            temporary.write_bytes(content)
    return tuple(out / name for name in contents)


def write_section(
    page: Path, run: Run, made: Sequence[Table], drawn: Mapping[str, tuple[str, Figure]]
) -> tuple[Path, ...]:
    """Put a run's tables and figures into the page, in place of an older run of its title.

    Args:
        page: Has, or gets at its end, a place between two markers with the title. Figures go into `images`
            beside it.
        run: What was done.
        made: Its tables.
        drawn: Its figures.

    Returns:
        What was written.

    Raises:
        InputError: there is no such page, or only one of its two markers is there.
    """
    if not page.is_file():
        raise InputError(f"{page}: no such page: give one that is there")
    stem = "evaluation-" + re.sub(r"[^a-z0-9]+", "-", run.title.lower()).strip("-")
    images = {f"{stem}-{name}": content for name, content in drawn.items()}
    for name, (_, figure) in images.items():
        with replacing(page.parent / "images" / name) as temporary:
            temporary.write_bytes(png(figure))
    links = [f"![{caption}](images/{name})\n" for name, (caption, _) in images.items()]
    section = "\n".join([f"## {run.title}\n", _about(run), *(markdown(table) for table in made), *links])
    with replacing(page) as temporary:
        temporary.write_text(_placed(page.read_text(), page, run.title, section))
    return (page, *(page.parent / "images" / name for name in images))


def _placed(text: str, page: Path, title: str, section: str) -> str:
    start, end = START.format(title), END.format(title)
    inside = f"{start}\n\n{section.strip()}\n\n{end}"
    if start not in text and end not in text:
        return f"{text.rstrip()}\n\n{inside}\n"
    if text.count(start) != 1 or text.count(end) != 1 or text.index(start) > text.index(end):
        raise InputError(f"{page}: expected {start} and {end} once each, in this order")
    before, after = text.split(start)[0], text.split(end)[1]
    return before + inside + after


def _about(run: Run) -> str:
    told = {
        "given": "as the cases say",
        "right": "peaked on the true material",
        "uniform": "every material as likely",
        "wrong": "peaked, on a wrong material in three parts of ten",
    }[run.opinion]
    return (
        f"{run.objects} objects and {run.clips} clips of `{run.data}`, priors {told}; {run.date}, by\n\n"
        f"```\n{run.command}\n```\n\n"
        "Means over objects with 95 % intervals (bootstrap over objects).\n"
    )
