"""A page of the documentation: sections that commands write, between words that people write."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from model.errors import InputError
from model.formats.files import check_writable, replacing

START, END = "<!-- {}: {} -->", "<!-- end of {}: {} -->"
"""Around what a command has written under a title."""
EARLIER = "*Of an earlier run, whose tables are in the history of this page: "
"""How a line begins that says of which run words are."""


@dataclass(frozen=True)
class Section:
    """What a command has to say of one of its runs."""

    command: str
    title: str
    run: str
    """One line: what was done, and when."""
    body: str
    """The rest, in Markdown."""
    figures: Mapping[str, tuple[str, bytes]]
    """Caption and PNG by the end of its name, `errors.png`; they stand below the body."""


def check_section(page: Path, command: str, title: str) -> None:
    """See that a section can be put into a page, before the work that it tells of.

    Raises:
        InputError: it cannot be written, or only one of the section's two markers is there.
    """
    check_writable(page)
    _marks(page.read_text() if page.is_file() else "", page, command, title)


def write_section(page: Path, section: Section, head: str | None = None) -> tuple[Path, ...]:
    """Put a section into a page, in place of an older one of its title.

    What people have written below the older one stays. Where the new one says something else, the subsections
    among it (`### …`) are told to be of the earlier run.

    Args:
        page: Has, or gets at its end, a place between two markers with the title. Figures go into `images`
            beside it.
        section: What is written.
        head: How a page begins that is not there yet; None: it has to be there.

    Returns:
        What was written.

    Raises:
        InputError: there is no such page, or only one of its two markers is there.
    """
    if head is None and not page.is_file():
        raise InputError(f"{page}: no such page: give one that is there")
    stem = f"{section.command}-" + re.sub(r"[^a-z0-9]+", "-", section.title.lower()).strip("-")
    images = {f"{stem}-{name}": figure for name, figure in section.figures.items()}
    links = [f"![{caption}](images/{name})" for name, (caption, _) in images.items()]
    paragraphs = [f"## {section.title}", section.run, section.body.strip(), *links]
    text = _placed(page.read_text() if page.is_file() else head or "", page, section, paragraphs)
    for name, (_, content) in images.items():
        with replacing(page.parent / "images" / name) as temporary:
            temporary.write_bytes(content)
    with replacing(page) as temporary:
        temporary.write_text(text)
    return (page, *(page.parent / "images" / name for name in images))


def _placed(text: str, page: Path, section: Section, paragraphs: list[str]) -> str:
    start, end = _marks(text, page, section.command, section.title)
    inside = "\n\n".join(paragraphs)
    whole = f"{start}\n\n{inside}\n\n{end}"
    if start not in text:
        return f"{text.rstrip()}\n\n{whole}\n"
    before, rest = text.split(start)
    former, after = rest.split(end)
    said = former.strip().split("\n\n")
    if len(said) > 1 and said[2:] != inside.split("\n\n")[2:]:
        after = _dated(after, said[1])
    return before + whole + after


def _marks(text: str, page: Path, command: str, title: str) -> tuple[str, str]:
    """Where the section begins and where it ends: both are in the text, or neither is."""
    start, end = (mark.format(command, title) for mark in (START, END))
    counts = text.count(start), text.count(end)
    if counts != (0, 0) and (counts != (1, 1) or text.index(start) > text.index(end)):
        raise InputError(f"{page}: expected {start} and {end} once each, in this order")
    return start, end


def _dated(after: str, run: str) -> str:
    """The text after a section; subsections before the next one say of which run they are, unless they do."""
    below, *further = re.split(r"(?m)^(?=## |<!-- )", after, maxsplit=1)
    untold = rf"(?m)^(### .*\n)(?!\n{re.escape(EARLIER)})"
    return "".join([re.sub(untold, lambda heading: f"{heading[1]}\n{EARLIER}{run}*\n", below), *further])
