"""Time per substep of the plain torch simulator, and of the ways to sum edge forces on points.

Run: `python benchmarks/simulator/oracle.py [--threads 2] [--repeats 30] [--clock cpu]`
All columns of a table are measured in turns, so that a busy machine slows them alike. On a machine that
others use, take one thread and `--clock cpu`, which counts only the time that the processor gave.
"""

import argparse
import time
from collections.abc import Callable

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor

from model.simulator.build import build_simulator
from model.simulator.simulator import Simulator
from model.simulator.system import Anchors

SIZES = ((500, 5_000), (1_500, 15_000), (2_000, 20_000), (8_000, 120_000))
STEPS = 20
"""Substeps per measurement."""


def scene(points: int, springs: int, held: int = 20, collision_distance: float | None = None) -> Simulator:
    """A block of random points over the ground, each joined to its nearest, some of them held."""
    rng = np.random.default_rng(0)
    places = (rng.random((points, 3)) * 0.2 + [0, 0, 0.01]).astype(np.float32)
    _, near = cKDTree(places).query(places, k=2 * springs // points + 6)
    pairs = np.stack([np.repeat(np.arange(points), near.shape[1] - 1), near[:, 1:].ravel()], axis=1)
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    pairs = pairs[np.sort(rng.permutation(len(pairs))[:springs])]
    return build_simulator(
        points=places,
        mass=np.full(points, 1e-3, np.float32),
        springs=pairs,
        rest_length=np.linalg.norm(places[pairs[:, 0]] - places[pairs[:, 1]], axis=1),
        stiffness=np.full(springs, 50, np.float32),
        controller_springs=np.stack([np.arange(held), np.arange(held)], axis=1),
        controller_rest_length=np.full(held, 0.02, np.float32),
        controller_stiffness=np.full(held, 50, np.float32),
        controller_points=places[:held] + np.float32([0, 0, 0.02]),
        dashpot_damping=0.01,
        drag_rate=1.0,
        friction=0.4,
        restitution=0.1,
        ground_height=0.0,
        collision_distance=collision_distance,
    )


def substeps(simulator: Simulator, gradients: bool) -> Callable[[], None]:
    """Run STEPS substeps, with the backward pass to every stiffness where asked."""
    places = simulator.system.controller_points
    assert places is not None
    anchors = Anchors(places, torch.zeros_like(places))
    stiffness = simulator.force("spring").log_stiffness.requires_grad_(gradients)
    dt, start = 1e-4, simulator.rest_state()

    def run() -> None:
        with torch.set_grad_enabled(gradients):
            dynamics, state = simulator.dynamics(), start
            for _ in range(STEPS):
                state = simulator.integrator.step(dynamics, state, anchors, dt)
            if gradients:
                torch.autograd.grad(state.positions.sum(), stiffness)

    return run


def sums(simulator: Simulator) -> dict[str, Callable[[], Tensor]]:
    """Ways to add the force of every edge to its two ends."""
    edges, count = simulator.system.edges, simulator.system.edges.node_count
    flows = torch.randn(len(edges), 3)
    first, second = edges.first, edges.second
    degree = torch.bincount(torch.cat([first, second]), minlength=count)
    widest = int(degree.max())
    padded = torch.full((count, widest), len(edges))
    signs = torch.zeros((count, widest, 1))
    filled = [0] * count
    for end, sign in ((first, -1.0), (second, 1.0)):
        for edge, node in enumerate(end.tolist()):
            padded[node, filled[node]], signs[node, filled[node], 0] = edge, sign
            filled[node] += 1

    def gather() -> Tensor:
        extended = torch.cat([flows, flows.new_zeros(1, 3)])
        return (extended[padded] * signs).sum(1)

    ways = {
        "sparse rows": lambda: edges.total(flows),
        "index_add": lambda: (
            torch.zeros(count, 3).index_add_(0, first, flows, alpha=-1).index_add_(0, second, flows)
        ),
        "padded gather": gather,
    }
    for way in ways.values():
        torch.testing.assert_close(way(), edges.total(flows), rtol=1e-4, atol=1e-4)
    return ways


def in_turns(
    runs: dict[str, Callable[[], object]], repeats: int, per: int, clock: Callable[[], float]
) -> dict[str, tuple[float, float]]:
    """Median and lower quartile [µs] of each, measured in turns after two warm-ups."""
    taken: dict[str, list[float]] = {name: [] for name in runs}
    for turn in range(repeats + 2):
        for name, run in runs.items():
            begun = clock()
            run()
            if turn >= 2:
                taken[name].append((clock() - begun) / per * 1e6)
    return {name: (float(np.median(t)), float(np.quantile(t, 0.25))) for name, t in taken.items()}


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=30)
    parser.add_argument("--clock", choices=("wall", "cpu"), default="wall")
    options = parser.parse_args()
    clock = time.process_time if options.clock == "cpu" else time.perf_counter
    torch.set_num_threads(options.threads)
    print(f"{options.threads} threads, float32, {options.clock} time [µs]: median (lower quartile)\n")
    print("| points / springs | forward | forward + backward | forward, self-collision | stability bound |")
    print("|---|---|---|---|---|")
    for points, springs in SIZES:
        plain, colliding = scene(points, springs), scene(points, springs, collision_distance=0.005)
        runs = {
            "forward": substeps(plain, gradients=False),
            "both": substeps(scene(points, springs), gradients=True),
            "self": substeps(colliding, gradients=False),
        }
        row = in_turns(runs, options.repeats, STEPS, clock)
        row |= in_turns({"bound": lambda: plain.needed_substeps(1 / 30)}, 3, 1, clock)  # noqa: B023
        print(f"| {points} / {springs} | " + " | ".join(f"{m:.0f} ({q:.0f})" for m, q in row.values()) + " |")
    print("\n| points / springs | " + " | ".join(sums(scene(100, 500))) + " |\n|---|---|---|---|")
    for points, springs in SIZES:
        row = in_turns(dict(sums(scene(points, springs))), 4 * options.repeats, 1, clock)
        print(f"| {points} / {springs} | " + " | ".join(f"{m:.0f} ({q:.0f})" for m, q in row.values()) + " |")


if __name__ == "__main__":
    main()
