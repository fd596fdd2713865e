"""The compiled kernel against plain torch, NVIDIA Warp, Newton and MuJoCo: time, memory, limits, exactness.

Run: `python benchmarks/simulator/kernel.py [--repeats 15] [--clock cpu] [--only time …] [--device cuda]`
What a table compares is measured in turns, so that a busy machine slows all of it alike; figures are medians,
with the quartiles of the ratio. On a machine that others use, `--clock cpu` counts only the time that the
processor gave; the two-thread table always takes wall time. `none`: MuJoCo has no gradient of a step.
Needs the `test` extra.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from kernel_warp import WarpSprings
from limits import limit_table
from oracle import scene
from peers import NAMES, STEPS, peers
from turns import Run, in_turns, spread

from model.simulator.kernel import build
from model.simulator.kernel.call import Interval
from model.simulator.kernel.cuda.kernel import CudaKernel
from model.simulator.kernel.kernel import Kernel
from model.simulator.simulator import Simulator
from model.simulator.system import Anchors, State

SIZES = ((500, 5_000), (2_000, 20_000), (8_000, 120_000))
FPS, PHYSTWIN = 30.0, 667
"""Frames per second, and the substeps that PhysTwin takes for each."""
DT = 1 / FPS / PHYSTWIN


def kernel_run(simulator: Simulator, steps: int, dt: float, gradients: bool, checkpoint: bool = False) -> Run:
    """Run substeps through the kernel, with the backward pass to every stiffness where asked."""
    stiffness = simulator.force("spring").log_stiffness.requires_grad_(gradients)
    start, hands = simulator.rest_state(), simulator.system.controller_points
    kind = CudaKernel if start.positions.is_cuda else Kernel
    kernel = kind(simulator.dynamics(), simulator.integrator, torch.Size(()))
    interval = Interval(dt, steps, dt * steps)

    def run() -> torch.Tensor:
        with torch.set_grad_enabled(gradients):
            end = kernel.advance(start, (hands, hands), interval, gradients and not checkpoint).positions
        return torch.autograd.grad(end.sum(), stiffness, retain_graph=True)[0] if gradients else end

    return run


def oracle_run(simulator: Simulator, steps: int, dt: float, gradients: bool) -> Run:
    """The same in plain torch."""
    stiffness = simulator.force("spring").log_stiffness.requires_grad_(gradients)
    anchors = Anchors(
        simulator.system.controller_points, torch.zeros_like(simulator.system.controller_points)
    )

    def run() -> torch.Tensor:
        with torch.set_grad_enabled(gradients):
            state, dynamics = simulator.rest_state(), simulator.dynamics()
            for _ in range(steps):
                state = simulator.integrator.step(dynamics, state, anchors, dt)
        return torch.autograd.grad(state.positions.sum(), stiffness)[0] if gradients else state.positions

    return run


def time_table(repeats: int, clock: Callable[[], float]) -> None:
    """Time per substep, one thread each."""
    torch.set_num_threads(1)
    others = ("torch", *NAMES)
    print("\n## time per substep, one thread each [us]\n")
    heads = [*others, "kernel", *(f"{name}/kernel" for name in others)]
    print("| points / springs | pass | " + " | ".join(heads) + " |\n" + "|---" * (2 + len(heads)) + "|")
    steps = {"torch": 5, **STEPS, "kernel": 100}
    for points, springs in SIZES:
        simulator = scene(points, springs)
        for gradients in (False, True):
            runs = {
                "torch": oracle_run(simulator, steps["torch"], DT, gradients),
                **peers(simulator, DT, gradients),
                "kernel": kernel_run(simulator, steps["kernel"], DT, gradients),
            }
            seconds = in_turns(runs, repeats, clock)
            micro = {name: 1e6 * value / steps[name] for name, value in seconds.items()}
            cells = [f"{np.median(micro[n]):.0f}" if n in micro else "none" for n in (*others, "kernel")]
            cells += [spread(micro[n] / micro["kernel"]) if n in micro else "none" for n in others]
            print(
                f"| {points} / {springs} | {'fwd+bwd' if gradients else 'fwd'} | " + " | ".join(cells) + " |"
            )


def device_table(repeats: int) -> None:
    """Time per substep on a CUDA device, waited for, and of the processor's kernel on one thread."""
    torch.set_num_threads(1)
    names = ("torch", "Warp", "kernel", "processor")
    print(f"\n## time per substep on {torch.cuda.get_device_name()}, and on one thread here [us]\n")
    heads = [*names, *(f"{name}/kernel" for name in names if name != "kernel")]
    print("| points / springs | pass | " + " | ".join(heads) + " |\n" + "|---" * (2 + len(heads)) + "|")
    steps = {"torch": 5, "Warp": STEPS["Warp"], "kernel": 100, "processor": 100}

    def waited(run: Run) -> Run:
        def go() -> object:
            done = run()
            torch.cuda.synchronize()  # of the whole device, so Warp's streams too
            return done

        return go

    for points, springs in SIZES:
        here, there = scene(points, springs), scene(points, springs).to("cuda")
        for gradients in (False, True):
            runs = {
                "torch": waited(oracle_run(there, steps["torch"], DT, gradients)),
                "Warp": waited(WarpSprings(here, DT, steps["Warp"], gradients, "cuda").run),
                "kernel": waited(kernel_run(there, steps["kernel"], DT, gradients)),
                "processor": kernel_run(here, steps["processor"], DT, gradients),
            }
            seconds = in_turns(runs, repeats, time.perf_counter)
            micro = {name: 1e6 * value / steps[name] for name, value in seconds.items()}
            cells = [f"{np.median(micro[name]):.1f}" for name in names]
            cells += [spread(micro[name] / micro["kernel"]) for name in names if name != "kernel"]
            print(
                f"| {points} / {springs} | {'fwd+bwd' if gradients else 'fwd'} | " + " | ".join(cells) + " |"
            )


def frame_table(repeats: int, clock: Callable[[], float]) -> None:
    """A frame's full gradient, with the substeps that each needs."""
    torch.set_num_threads(1)
    print(f"\n## a frame's full gradient: substeps from the bound, against Warp at {PHYSTWIN} [ms]\n")
    print("| points / springs | substeps | kernel | with rollout and bound | Warp | ratio | with both |")
    print("|---|---|---|---|---|---|---|")
    for points, springs in SIZES[1:]:
        simulator = scene(points, springs)
        stiffness = simulator.force("spring").log_stiffness
        count = simulator.needed_substeps(1 / FPS)
        pieces = 29  # Warp's graph holds a 29th of a frame; its states would not fit otherwise

        def rollout(simulator: Simulator = simulator, stiffness: torch.Tensor = stiffness) -> object:
            end = simulator.rollout(frames=2, fps=FPS).end
            return torch.autograd.grad(end.positions.sum(), stiffness)

        runs = {
            "kernel": kernel_run(simulator, count, 1 / FPS / count, True),
            "rollout": rollout,
            "warp": WarpSprings(simulator, DT, PHYSTWIN // pieces, True).run,
        }
        milli = {name: 1e3 * value for name, value in in_turns(runs, repeats, clock).items()}
        milli["warp"] = milli["warp"] * pieces
        middle = " | ".join(f"{np.median(value):.1f}" for value in milli.values())
        ratios = " | ".join(spread(milli["warp"] / milli[name]) for name in ("kernel", "rollout"))
        print(f"| {points} / {springs} | {count} | {middle} | {ratios} |")


def thread_table(repeats: int) -> None:
    """Two threads against one, wall time."""
    print("\n## two threads against one, wall time\n")
    print("| points / springs | pass | one [us] | two [us] | ratio |\n|---|---|---|---|---|")
    for points, springs in SIZES[1:]:
        simulator = scene(points, springs)
        for gradients in (False, True):
            run = kernel_run(simulator, 100, DT, gradients)

            def with_threads(count: int, run: Run = run) -> Run:
                def go() -> object:
                    torch.set_num_threads(count)
                    return run()

                return go

            seconds = in_turns({"1": with_threads(1), "2": with_threads(2)}, repeats, time.perf_counter)
            micro = {name: 1e4 * value for name, value in seconds.items()}
            print(
                f"| {points} / {springs} | {'fwd+bwd' if gradients else 'fwd'} | {np.median(micro['1']):.0f} "
                f"| {np.median(micro['2']):.0f} | {spread(micro['1'] / micro['2'])} |"
            )
    torch.set_num_threads(1)


def memory_table() -> None:
    """What a gradient through 30 frames of 667 substeps adds to a process, checkpointed by frames."""
    print(f"\n## extra memory: the gradient through 30 frames of {PHYSTWIN} substeps, checkpointed\n")
    print("| points / springs | peak above what was there [MB] |\n|---|---|")
    for points, springs in SIZES[1:]:
        ask = [sys.executable, __file__, "--peak", str(points), str(springs)]
        said = subprocess.run(ask, capture_output=True, text=True, check=True).stdout.split()[-1]
        print(f"| {points} / {springs} | {float(said):.0f} |")


def peak(points: int, springs: int) -> float:
    """Megabytes that the gradient needs above what the process has after one of two frames."""
    simulator = scene(points, springs)
    stiffness = simulator.force("spring").log_stiffness.requires_grad_()

    def gradient(frames: int) -> None:
        rollout = simulator.rollout(frames=frames + 1, fps=FPS, substeps=PHYSTWIN, checkpoint=True)
        torch.autograd.grad(rollout.points.sum(), stiffness)

    gradient(1)
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
    before = resident("VmRSS")
    gradient(30)
    return resident("VmHWM") - before


def resident(what: str) -> float:
    """Memory of this process [MB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(what)) / 1024


def exact_table() -> None:
    """Gradients of one frame in float32 against the oracle in float64."""
    torch.set_num_threads(2)
    print("\n## one frame's gradients in float32 against the float64 oracle, relative\n")
    print("| points / springs | substeps | constant | kernel | torch float32 |\n|---|---|---|---|---|")
    for points, springs in SIZES[:2]:
        simulator = scene(points, springs)
        count = simulator.needed_substeps(1 / FPS)
        found = {
            "kernel": frame_gradients(simulator.with_backend("kernel"), count),
            "torch": frame_gradients(simulator.with_backend("torch"), count),
            "exact": frame_gradients(scene(points, springs).double().with_backend("torch"), count),
        }
        for name, exact in found["exact"].items():
            apart = [float((found[by][name] - exact).norm() / exact.norm()) for by in ("kernel", "torch")]
            print(f"| {points} / {springs} | {count} | {name} | {apart[0]:.1e} | {apart[1]:.1e} |")


def frame_gradients(simulator: Simulator, count: int) -> dict[str, torch.Tensor]:
    """Of a weighted sum of where the points are after a frame in which many meet the ground."""
    places = simulator.system.points
    start = State(places, torch.tensor([0.3, 0.1, -1.0]).to(places).expand_as(places))
    wanted = {
        name: simulator.get_parameter(name).requires_grad_()
        for name in (
            "forces.spring.log_stiffness",
            "forces.dashpot.log_dashpot_damping",
            "forces.drag.log_drag_rate",
            "contacts.ground.log_friction",
            "contacts.ground.log_restitution",
        )
    }
    end = simulator.rollout(start, frames=2, fps=FPS, substeps=count).end.positions
    weights = torch.from_numpy(np.random.default_rng(0).normal(size=end.shape)).to(end)
    gradients = torch.autograd.grad((weights * end).sum(), list(wanted.values()))
    return {name: gradient.double() for name, gradient in zip(wanted, gradients, strict=True)}


def build_table() -> None:
    """Seconds to build a kernel that nobody has built."""
    print("\n## first build of a kernel [s]\n")
    simulator = scene(*SIZES[0])
    with tempfile.TemporaryDirectory() as folder:
        os.environ["XDG_CACHE_HOME"] = folder
        for what in ("compile", "load from the cache"):
            build.load.cache_clear()
            began = time.perf_counter()
            Kernel(simulator.dynamics(), simulator.integrator, torch.Size(()))
            print(f"- {what}: {time.perf_counter() - began:.2f}")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    tables = ("time", "frame", "threads", "limit", "memory", "exact", "build")
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--clock", choices=("wall", "cpu"), default="wall")
    parser.add_argument("--only", nargs="+", choices=tables, default=tables)
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help="cuda: that table alone")
    parser.add_argument("--peak", nargs=2, type=int, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.peak:
        print(peak(*args.peak))
        return
    if args.device == "cuda":
        if not torch.cuda.is_available():
            parser.exit(2, "--device cuda: torch sees no CUDA device here\n")
        device_table(args.repeats)
        return

    def forward(simulator: Simulator) -> Run:
        return kernel_run(simulator, 100, DT, False)

    clock = time.process_time if args.clock == "cpu" else time.perf_counter
    runs = {
        "time": lambda: time_table(args.repeats, clock),
        "frame": lambda: frame_table(args.repeats, clock),
        "threads": lambda: thread_table(args.repeats),
        "limit": lambda: limit_table(SIZES, forward, args.repeats, clock),
        "memory": memory_table,
        "exact": exact_table,
        "build": build_table,
    }
    for name in args.only:
        runs[name]()


if __name__ == "__main__":
    main()
