"""Build the twin of twin.npz in Newton and run it under the recorded motion of the hand.

    python run.py --out trajectory.npz     # writes times [T] and points [T, N, 3]

Needs the packages newton, warp-lang and numpy. `build` makes the model, to be used in a scene of your own;
what Newton's particles lack (drag, the impact of the ground) is `finish`, to be launched after each step.
"""

import argparse
import sys
import time
from pathlib import Path
from typing import Any

import newton
import numpy as np
import warp as wp


@wp.kernel  # type: ignore[untyped-decorator]
def drive(
    before: wp.array[wp.vec3],
    after: wp.array[wp.vec3],
    share: float,
    interval: float,
    first: int,
    q: wp.array[wp.vec3],
    qd: wp.array[wp.vec3],
) -> None:
    """Put the controllers where they are after this share of the way to the next frame."""
    i = wp.tid()
    way = after[i] - before[i]
    q[first + i] = before[i] + way * share  # type: ignore[operator]
    qd[first + i] = way / interval  # type: ignore[operator]


@wp.kernel  # type: ignore[untyped-decorator]
def finish(
    start: wp.array[wp.vec3],
    dt: float,
    decay: float,
    ground: int,
    height: float,
    restitution: float,
    friction: float,
    q: wp.array[wp.vec3],
    qd: wp.array[wp.vec3],
) -> None:
    """Drag, then the impact of the ground, on velocities; positions follow from where the step started."""
    i = wp.tid()
    v = qd[i] * decay
    x = start[i]
    if ground == 1 and v[2] < 0.0 and x[2] + dt * v[2] < height:
        approach = -v[2]
        slip = wp.max(wp.sqrt(v[0] * v[0] + v[1] * v[1]), 1.0e-12)
        kept = wp.max(0.0, 1.0 - friction * (1.0 + restitution) * approach / slip)
        v = wp.vec3(v[0] * kept, v[1] * kept, restitution * approach)
    q[i] = x + dt * v
    qd[i] = v


def build(twin: dict[str, np.ndarray]) -> Any:  # noqa: ANN401 - newton.Model, whose package has no types
    """Particles and springs; the last particles are the controllers, which the solver does not move."""
    points, hands = twin["points"], twin["controls"][0]
    builder = newton.ModelBuilder()
    builder.add_particles(
        pos=[wp.vec3(*place) for place in np.concatenate([points, hands]).tolist()],
        vel=[wp.vec3(0.0, 0.0, 0.0)] * (len(points) + len(hands)),
        mass=[*twin["mass"].tolist(), *[1.0] * len(hands)],
        flags=[int(newton.ParticleFlags.ACTIVE)] * len(points) + [0] * len(hands),
    )
    for (i, j), stiffness in zip(twin["edges"].tolist(), twin["stiffness"].tolist(), strict=True):
        builder.add_spring(i, j, stiffness, float(twin["dashpot_damping"]), control=0.0)
    builder.spring_rest_length = twin["rest_length"].tolist()
    model = builder.finalize()
    model.set_gravity(twin["gravity"].tolist())
    model.particle_grid = None  # particles do not meet each other
    return model


def simulate(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Times of the frames [s] and where the points are in each [m], shape [T, N, 3]."""
    with np.load(folder / "twin.npz") as file:
        twin = {name: file[name] for name in file.files}
    model = build(twin)
    solver = newton.solvers.SolverSemiImplicit(model)
    now, following = model.state(), model.state()
    times, substeps, count = twin["times"], int(twin["substeps"]), len(twin["points"])
    controls = [wp.array(frame, dtype=wp.vec3) for frame in twin["controls"].astype(np.float32)]
    ground, places = float(twin["ground_height"]), [twin["points"]]
    for frame in range(1, len(times)):
        interval = float(times[frame] - times[frame - 1])
        dt = interval / substeps
        law = [
            dt,
            float(np.exp(-twin["drag_rate"] * dt)),
            int(np.isfinite(ground)),
            float(np.nan_to_num(ground)),
        ]
        law += [float(twin["restitution"]), float(twin["friction"])]
        for substep in range(1, substeps + 1):
            hands = [controls[frame - 1], controls[frame], substep / substeps, interval, count]
            wp.launch(drive, len(controls[0]), inputs=[*hands, now.particle_q, now.particle_qd])
            now.clear_forces()
            solver.step(now, following, None, None, dt)
            moved = [following.particle_q, following.particle_qd]
            wp.launch(finish, count, inputs=[now.particle_q, *law, *moved])
            now, following = following, now
        places.append(now.particle_q.numpy()[:count].copy())
    return times, np.stack(places)


def main() -> None:
    """Read the arguments; run."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="where the trajectory goes")
    parser.add_argument("--device", help="of Warp: cpu, cuda:0; default: the fastest there is")
    arguments = parser.parse_args()
    if arguments.device is not None:
        wp.set_device(arguments.device)
    started = time.monotonic()
    times, points = simulate(Path(__file__).resolve().parent)
    with arguments.out.open("wb") as file:
        np.savez(file, times=times, points=points.astype(np.float32))
    taken = time.monotonic() - started
    sys.stdout.write(f"wrote {arguments.out}: {times[-1]:.2f} s of motion in {taken:.2f} s\n")


if __name__ == "__main__":
    main()
