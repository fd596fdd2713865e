"""A first look at what really moved: arrays of the shapes, units and limits of an observation."""

from pathlib import Path
from typing import Final

from model.formats.npz import read_arrays
from model.observation import NAMES, parse_observation
from worker.inspection.verdict import BrokenFileError, UnknownFormatError

MAX_FRAMES: Final = 3000
MAX_POINTS: Final = 20_000


def inspect(path: Path) -> str:
    """Look at a `.npz` as `docs/diagnosis.md` describes it; returns its suffix.

    Raises:
        UnknownFormatError: no zip archive.
        InputError: the archive is damaged, too large, or breaks the contract of observations.
        BrokenFileError: more frames or points than a diagnosis takes.
    """
    with path.open("rb") as file:
        if file.read(2) != b"PK":
            raise UnknownFormatError("not a NPZ file: send what numpy.savez writes")
    frames, points = parse_observation(read_arrays(path, NAMES), path.name).points.shape[:2]
    if frames > MAX_FRAMES or points > MAX_POINTS:
        raise BrokenFileError(
            f"{frames} frames of {points} points: at most {MAX_FRAMES} of {MAX_POINTS} are taken"
        )
    return ".npz"
