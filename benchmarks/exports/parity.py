"""An exported twin in the simulator that it was exported for, against the twin's own rollout."""

import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from model.bundle import TwinBundle
from model.exports import exporter_of
from model.exports.mechanics import roll

OWN_CONTACT = "mujoco, own contact"
"""The ground of `twin.xml` as MuJoCo simulates it, instead of the twin's impact that `replay.py` has."""
SCRIPTS = {
    "mujoco": ("mujoco", ["replay.py"]),
    OWN_CONTACT: ("mujoco", ["replay.py", "--ground", "contact"]),
    "newton": ("newton", ["run.py", "--device", "cpu"]),
}
"""The format of an export, what it is run by, and how, on the CPU."""


@dataclass(frozen=True)
class Parity:
    """How far apart the two are."""

    maximum: float
    """Over points and frames [m]."""
    mean: float
    travel: float
    """How far the points move, at most [m]."""
    seconds: float
    """What the other simulator took, its start included [s]."""


def compare(twin: TwinBundle, simulator: str, folder: Path) -> Parity:
    """Export to `folder`, run the export's own script there as its user would, and compare."""
    form, (script, *options) = SCRIPTS[simulator]
    exporter_of(form)(twin, folder)
    out, started = folder / "trajectory.npz", time.monotonic()
    command = [sys.executable, str(folder / script), "--out", str(out), *options]
    subprocess.run(command, check=True, capture_output=True)
    seconds, ours = time.monotonic() - started, roll(twin)
    with np.load(out) as theirs:
        np.testing.assert_allclose(theirs["times"], ours.times, atol=1e-9)
        away = np.linalg.norm(theirs["points"] - ours.points, axis=-1)
    travel = np.linalg.norm(ours.points - ours.points[0], axis=-1)
    return Parity(float(away.max()), float(away.mean()), float(travel.max()), seconds)
