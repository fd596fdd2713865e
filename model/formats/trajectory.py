"""A trajectory as a file: `times` [T] in seconds and `points` [T, N, 3] in metres, frame 0 at rest."""

from pathlib import Path

import numpy as np

from model.formats.files import replacing
from model.types import Trajectory


def write_trajectory(path: Path, trajectory: Trajectory) -> None:
    """Write a `.npz`; equal trajectories give equal bytes, and nobody sees half of one.

    Raises:
        InputError: nothing can be written at `path`.
    """
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, times=trajectory.times, points=trajectory.points)
