"""Frames per second of the playground, for a twin of 2 000 points.

Run: `python benchmarks/playground/run.py [--frames 90] [--twin OTHER.twin.zip]`
Each line is one thing that a user does. `wall` is what the clock on the wall says, on a machine that others
may be using; `cpu` is frames per second of processor time of one thread, which is what a free core gives. A
picture is one look at the stage (Gaussians carried along with the points), which another thread does.
"""

import argparse
import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from scipy.spatial import cKDTree

from model.bundle import TwinBundle
from model.playground.look import Look
from model.playground.session import Session
from model.schema import BundleManifest
from model.skinning import bind
from model.types import Gaussians, Parameter, Parameters, Topology

GAUSSIANS = 9_000
SPACING = 0.012
"""Of the points [m]."""


def block() -> TwinBundle:
    """A soft block of 10 × 20 × 10 points on a table, its upper end held; as stiff and heavy as a plush."""
    rng = np.random.default_rng(0)
    axes = [np.arange(count) for count in (10, 20, 10)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    points = (SPACING * (grid + rng.uniform(-0.1, 0.1, grid.shape) + [0, 0, 0.5])).astype(np.float32)
    springs = cKDTree(points).query_pairs(1.6 * SPACING, output_type="ndarray").astype(np.int32)
    length = np.linalg.norm(points[springs[:, 0]] - points[springs[:, 1]], axis=1).astype(np.float32)
    held = np.flatnonzero((grid[:, 1] == 19) & (grid[:, 2] == 9)).astype(np.int32)
    swing = 0.1 * np.sin(np.linspace(0, 2 * np.pi, 60))[:, None]
    controls = points[held][None].repeat(60, 0)
    controls[..., 2] += np.abs(swing)
    controls[..., 0] += swing
    means = (rng.uniform(points.min(0), points.max(0), (GAUSSIANS, 3))).astype(np.float32)
    index, weight = bind(means, points, springs=springs)
    units = {"dashpot_damping": "N*s/m", "drag_rate": "1/s", "friction": "1", "restitution": "1"}
    values = {"dashpot_damping": 0.005, "drag_rate": 1.0, "friction": 0.5, "restitution": 0.1}
    entries = {name: Parameter(value, units[name], "prior") for name, value in values.items()}
    entries["collision_distance"] = Parameter(0.3 * SPACING, "m", "prior")
    entries["ground_height"] = Parameter(0.0, "m", "prior")
    turns = np.tile(np.float32([1, 0, 0, 0]), (GAUSSIANS, 1))
    topology = Topology(
        points=points,
        mass=np.full(len(points), 1e-4, np.float32),
        springs=springs,
        rest_length=length,
        part=(grid[:, 1] // 4).astype(np.int32),
        binding_index=index,
        binding_weight=weight,
        controller_points=points[held],
        controller_springs=np.stack([np.arange(len(held), dtype=np.int32), held], axis=1),
        controller_rest_length=np.full(len(held), 1e-3, np.float32),
    )
    return TwinBundle(
        manifest=BundleManifest.model_validate({"schema": "matphys.twin/1", "source": {"fps": 30.0}}),
        gaussians=Gaussians(
            means=means,
            scales=np.full((GAUSSIANS, 3), 0.004, np.float32),
            quaternions=turns,
            opacities=np.full(GAUSSIANS, 0.9, np.float32),
            colors=np.full((GAUSSIANS, 3), 0.5, np.float32),
            volumes=np.full(GAUSSIANS, 1e-8, np.float32),
        ),
        topology=topology,
        parameters=Parameters(
            np.full(len(springs), 6.0, np.float32), np.full(len(held), 20.0, np.float32), entries
        ),
        controls=controls.astype(np.float32),
    )


def pull(session: Session) -> None:
    """Drag the end that is not held upwards, by a control point."""
    session.rest()
    session.free()
    points = session.bundle.topology.points
    above = points[(points[:, 2] - points[:, 1]).argmax()].astype(np.float64)
    session.grab(0, above + np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0]))
    grip = session.step().grips[0]
    session.drag(grip.number, grip.place + np.array([0.05, 0.1, 0.15]))


def blow(session: Session) -> None:
    """Wind, from rest."""
    session.rest()
    session.change(wind=(4.0, 0.0))


def fold(session: Session) -> None:
    """Drag one end over the other, so that the object meets itself."""
    session.change(wind=(0.0, 0.0))
    pull(session)
    grip = session.step().grips[0]
    session.drag(grip.number, grip.place + np.array([0.0, 0.2, 0.12]))


def measure(session: Session, frames: int) -> tuple[float, float, int]:
    """Frames per second by both clocks, and the most substeps of a frame; simulators are built before."""
    for _ in range(8):
        session.step()
    wall, cpu, substeps = time.perf_counter(), time.process_time(), 0
    for _ in range(frames):
        session.step()
        substeps = max(substeps, session.actors[0].substeps)
    return frames / (time.perf_counter() - wall), frames / (time.process_time() - cpu), substeps


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=90)
    parser.add_argument("--twin", type=Path)
    asked = parser.parse_args()
    torch.set_num_threads(1)
    bundle = block() if asked.twin is None else TwinBundle.load(asked.twin)
    session = Session(bundle)
    print(
        f"{len(bundle.topology.points)} points, {len(bundle.topology.springs)} springs, "
        f"{len(bundle.gaussians)} Gaussians; the machine has {os.cpu_count()} cores and a load of "
        f"{os.getloadavg()[0]:.1f}"
    )
    doings: dict[str, Callable[[Session], None]] = {
        "held by the hand": lambda s: s.rest(),
        "recorded motion": lambda s: s.play(),
        "dragged": pull,
        "in the wind": blow,
        "folded on itself": fold,
    }
    print(f"{'':18} {'frames/s wall':>14} {'frames/s cpu':>13} {'substeps':>9}")
    for name, begin in doings.items():
        begin(session)
        wall, cpu, substeps = measure(session, asked.frames)
        print(f"{name:18} {wall:14.0f} {cpu:13.0f} {substeps:9d}")
    look, points = Look(bundle), session.moment.points[0]
    look(points)
    start = time.process_time()
    for _ in range(20):
        look(points)
    print(f"a picture: {1e3 * (time.process_time() - start) / 20:.0f} ms of processor time")
    start = time.process_time()
    session.change(friction=0.77)
    for _ in range(6):
        session.step()
    rest = 6 / cpu
    print(f"a changed setting: {1e3 * max(0.0, time.process_time() - start - rest):.0f} ms of processor time")


if __name__ == "__main__":
    main()
