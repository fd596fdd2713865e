"""Replay the recorded motion of the hand on twin.xml in MuJoCo.

    python replay.py                          # in MuJoCo's viewer, in real time where the machine keeps up
    python replay.py --out trajectory.npz     # without a viewer; writes times [T] and points [T, N, 3]

Needs the packages mujoco and numpy.
"""

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import mujoco
import numpy as np


class Replay:
    """The twin of a folder, and the recorded motion of its controllers.

    The controllers are mocap bodies: MuJoCo knows where they are, but not how fast they move, so that the
    dampers between them and the points would see them at rest. `step` adds what is missing.
    """

    def __init__(self, folder: Path) -> None:
        """Load `twin.xml` and `replay.npz`."""
        self.model: Any = mujoco.MjModel.from_xml_path(str(folder / "twin.xml"))
        self.data: Any = mujoco.MjData(self.model)
        with np.load(folder / "replay.npz") as motion:
            self.rest, self.times, self.controls = motion["rest"], motion["times"], motion["controls"]
            self.grips, self.damping = motion["grips"], float(motion["dashpot_damping"])
            self.substeps = int(motion["substeps"])
        self.count = len(self.rest)

    @property
    def points(self) -> np.ndarray:
        """Where the points are [m], shape [N, 3]."""
        places: np.ndarray = self.rest + self.data.qpos[: 3 * self.count].reshape(-1, 3)
        return places

    def step(self, places: np.ndarray, speeds: np.ndarray) -> None:
        """One time step, with the controllers at `places` [m] and moving with `speeds` [m/s], each [C, 3]."""
        if len(places):
            self.data.mocap_pos[: len(places)] = places
            hand, point = self.grips.T
            axis = places[hand] - self.points[point]
            axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-12)
            pull = self.damping * np.sum(speeds[hand] * axis, axis=1, keepdims=True) * axis
            force = np.zeros((self.count, 3))
            np.add.at(force, point, pull)
            self.data.qfrc_applied[: 3 * self.count] = force.ravel()
        mujoco.mj_step(self.model, self.data)

    def frame(self, number: int) -> None:
        """All time steps from frame `number` - 1 to frame `number` of the recorded motion."""
        before, after = self.controls[number - 1], self.controls[number]
        speeds = (after - before) / (self.times[number] - self.times[number - 1])
        for substep in range(1, self.substeps + 1):
            self.step(before + (after - before) * (substep / self.substeps), speeds)


def simulate(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Times of the frames [s] and where the points are in each [m], shape [T, N, 3]."""
    replay = Replay(folder)
    places = [replay.points.copy()]
    for number in range(1, len(replay.times)):
        replay.frame(number)
        places.append(replay.points.copy())
    return replay.times, np.stack(places)


def show(folder: Path) -> None:
    """Play the motion in the viewer, over and over, until its window is closed."""
    import mujoco.viewer

    replay = Replay(folder)
    with mujoco.viewer.launch_passive(replay.model, replay.data) as viewer:
        while viewer.is_running():
            mujoco.mj_resetData(replay.model, replay.data)
            started = time.monotonic()
            for number in range(1, len(replay.times)):
                replay.frame(number)
                viewer.sync()
                time.sleep(max(0.0, float(replay.times[number]) - (time.monotonic() - started)))
                if not viewer.is_running():
                    return


def main() -> None:
    """Read the arguments; replay."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, help="write the trajectory here instead of showing it")
    out = parser.parse_args().out
    folder = Path(__file__).resolve().parent
    if out is None:
        show(folder)
        return
    started = time.monotonic()
    times, points = simulate(folder)
    with out.open("wb") as file:
        np.savez(file, times=times, points=points.astype(np.float32))
    taken = time.monotonic() - started
    sys.stdout.write(f"wrote {out}: {times[-1]:.2f} s of motion in {taken:.2f} s\n")


if __name__ == "__main__":
    main()
