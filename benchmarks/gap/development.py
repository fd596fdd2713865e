"""Development worlds, as a benchmark's command line is given them, and work on many of them."""

import argparse
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from pathlib import Path
from typing import get_args

import torch

from model.crew import crew
from model.gap.benchmark.labels import PLAIN, Label, open_labels
from model.gap.bodies.guess import Shape

HEALTHY = "null"
KINDS: tuple[Shape, ...] = get_args(Shape)


def healthy_worlds(description: str | None, arguments: list[str] | None) -> list[tuple[Path, Label]]:
    """Healthy worlds of the folders that a command is given, each with its folder; warnings are off then.

    A folder whose labels are sealed ends the command: its worlds are for one look alone.

    Args:
        description: Of the command, for `--help`.
        arguments: Of the command; None: of this process.
    """
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("worlds", type=Path, nargs="+")
    ask_kinds(parser)
    options = parser.parse_args(arguments)
    folders: list[Path] = options.worlds
    labels = [(folder, label) for folder in folders for label in open_labels_of(folder, parser, "it asks of")]
    warnings.simplefilter("ignore")
    torch.set_num_threads(1)
    healthy = [(folder, label) for folder, label in labels if label["category"] == HEALTHY]
    return [(folder, label) for folder, label in healthy if label["kind"] in options.kind]


def ask_kinds(parser: argparse.ArgumentParser) -> None:
    """The option that leaves out objects of other kinds."""
    parser.add_argument("--kind", choices=KINDS, nargs="+", default=KINDS, help="of objects, these alone")


def open_labels_of(folder: Path, parser: argparse.ArgumentParser, what: str) -> list[Label]:
    """The labels of development worlds; sealed ones end the command.

    Args:
        folder: Of the worlds.
        parser: Of the command.
        what: Is done with them, for the message.
    """
    if not (folder / PLAIN).is_file():
        parser.error(f"{folder} has no open labels ({PLAIN}): {what} development worlds alone")
    return open_labels(folder)


def done_by(workers: int, jobs: Sequence[Callable[[], str]]) -> None:
    """Jobs done in so many processes, which share the cores; what each returns is printed as it ends."""
    with crew(workers) as pool:
        for done, future in enumerate(as_completed([pool.submit(job) for job in jobs]), 1):
            print(f"{done}/{len(jobs)} {future.result()}", flush=True)
