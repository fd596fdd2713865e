"""What the commands share: kinds of arguments, checks before work, and what is said after it."""

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import click
from threadpoolctl import threadpool_limits

from model.errors import InputError
from model.formats.files import check_writable

InputFile = click.Path(exists=True, dir_okay=False, path_type=Path)
OutputFile = click.Path(path_type=Path)


def check_outputs(sources: Iterable[Path | None], *outputs: Path | None) -> None:
    """Refuse, before any work, outputs that cannot be written or would take the place of another file.

    Args:
        sources: All files that are read.
        outputs: All that are written.
    """
    read = [source.resolve() for source in sources if source is not None]
    taken = {path: "the input" if path == read[0] else "read by this command" for path in reversed(read)}
    written: list[Path] = []
    for output in outputs:
        if output is None:
            continue
        check_writable(output)
        place = output.resolve()
        if place in taken:
            raise InputError(f"{output} is {taken[place]}: give the output another name")
        if any(place in other.parents or other in place.parents for other in written):
            raise InputError(f"{output} is above or below another output: give the output another name")
        taken[place] = "another output"
        written.append(place)


def default_to_one_thread() -> None:
    """Torch and BLAS keep to one thread from here on, unless OMP_NUM_THREADS says otherwise.

    Its operations here are small: a second thread gains a tenth when alone, and spins the preview to a
    quarter of its speed beside OpenCV's own threads. The simulator's kernel has threads of its own.
    """
    import torch

    if "OMP_NUM_THREADS" not in os.environ:
        torch.set_num_threads(1)
        threadpool_limits(1, "blas")


def one_line(message: str) -> str:
    """The message without line breaks and control codes, whatever a file or an option put into it."""
    return " ".join("".join(c if c.isprintable() else " " for c in message).split())


def warn(doubts: Iterable[str]) -> None:
    """Each doubt once, a line each, on stderr."""
    for doubt in dict.fromkeys(doubts):
        click.echo(f"warning: {one_line(doubt)}", err=True)


def print_json(content: Mapping[str, Any]) -> None:
    """As JSON on stdout."""
    click.echo(json.dumps(content, ensure_ascii=False, indent=1, allow_nan=False))
