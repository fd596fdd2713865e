"""The development worlds in which nothing is missing, as a benchmark's command line is given them."""

import argparse
import warnings
from pathlib import Path

import torch

from model.gap.benchmark.labels import PLAIN, Label, open_labels

HEALTHY = "null"


def healthy_worlds(description: str | None, arguments: list[str] | None) -> tuple[Path, list[Label]]:
    """The folder that a command was given, and the labels of its healthy worlds; warnings are off afterwards.

    A folder whose labels are sealed ends the command: its worlds are for one look alone.

    Args:
        description: Of the command, for `--help`.
        arguments: Of the command; None: of this process.
    """
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("worlds", type=Path)
    folder: Path = parser.parse_args(arguments).worlds
    if not (folder / PLAIN).is_file():
        parser.error(f"{folder}: expected development worlds with {PLAIN}")
    warnings.simplefilter("ignore")
    torch.set_num_threads(1)
    return folder, [label for label in open_labels(folder) if label["category"] == HEALTHY]
