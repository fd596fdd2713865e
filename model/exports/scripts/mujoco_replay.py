"""Replay the recorded motion of the hand on twin.xml in MuJoCo.

    python replay.py                          # in MuJoCo's viewer, in real time where the machine keeps up
    python replay.py --out trajectory.npz     # without a viewer; writes times [T] and points [T, N, 3]
    python replay.py --ground contact         # on the ground of twin.xml as MuJoCo simulates it

Without `--ground contact` the ground is the twin's: an impact, which MuJoCo does not have. Needs the packages
mujoco and numpy.
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

    With `impact`, points meet the ground by the twin's own law, after each step, instead of by the contacts
    of `twin.xml`, which are springs and dampers that take some steps.
    """

    def __init__(self, folder: Path, impact: bool = True) -> None:
        """Load `twin.xml` and `replay.npz`."""
        self.model: Any = mujoco.MjModel.from_xml_path(str(folder / "twin.xml"))
        self.data: Any = mujoco.MjData(self.model)
        with np.load(folder / "replay.npz") as motion:
            self.rest, self.times, self.controls = motion["rest"], motion["times"], motion["controls"]
            self.grips, self.damping = motion["grips"], float(motion["dashpot_damping"])
            self.substeps = int(motion["substeps"])
            self.ground, self.friction = float(motion["ground_height"]), float(motion["friction"])
            self.restitution = float(motion["restitution"])
        self.count = len(self.rest)
        self.impact = impact and bool(np.isfinite(self.ground))
        if self.impact:
            self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT

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
        if self.impact:
            self._meet_ground()

    def _meet_ground(self) -> None:
        """Turn back what has come below the ground in this step, from where it was before.

        The normal speed is turned around and keeps its share; the tangential one loses what Coulomb's
        friction takes of it.
        """
        dt, end = self.model.opt.timestep, 3 * self.count
        speed = self.data.qvel[:end].reshape(-1, 3)
        below = np.flatnonzero((self.points[:, 2] < self.ground) & (speed[:, 2] < 0.0))
        if len(below):
            before = speed[below]
            after, approach = before.copy(), -before[:, 2]
            slip = np.maximum(np.linalg.norm(before[:, :2], axis=1), 1e-12)
            lost = self.friction * (1.0 + self.restitution) * approach / slip
            after[:, :2] *= np.maximum(0.0, 1.0 - lost)[:, None]
            after[:, 2] = self.restitution * approach
            speed[below] = after
            self.data.qpos[:end].reshape(-1, 3)[below] += dt * (after - before)

    def frame(self, number: int) -> None:
        """All time steps from frame `number` - 1 to frame `number` of the recorded motion."""
        before, after = self.controls[number - 1], self.controls[number]
        speeds = (after - before) / (self.times[number] - self.times[number - 1])
        for substep in range(1, self.substeps + 1):
            self.step(before + (after - before) * (substep / self.substeps), speeds)


def simulate(replay: Replay) -> tuple[np.ndarray, np.ndarray]:
    """Times of the frames [s] and where the points are in each [m], shape [T, N, 3]."""
    places = [replay.points.copy()]
    for number in range(1, len(replay.times)):
        replay.frame(number)
        places.append(replay.points.copy())
    return replay.times, np.stack(places)


def show(replay: Replay) -> None:
    """Play the motion in the viewer, over and over, until its window is closed."""
    import mujoco.viewer

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
    parser.add_argument(
        "--ground",
        choices=["impact", "contact"],
        default="impact",
        help="the twin's law, or MuJoCo's contact",
    )
    arguments = parser.parse_args()
    out = arguments.out
    replay = Replay(Path(__file__).resolve().parent, impact=arguments.ground == "impact")
    if out is None:
        show(replay)
        return
    started = time.monotonic()
    times, points = simulate(replay)
    with out.open("wb") as file:
        np.savez(file, times=times, points=points.astype(np.float32))
    taken = time.monotonic() - started
    sys.stdout.write(f"wrote {out}: {times[-1]:.2f} s of motion in {taken:.2f} s\n")


if __name__ == "__main__":
    main()
