"""Many worlds of one graph without gradients: side by side in vectors, or one after the other.

Run: `python benchmarks/simulator/worlds.py [--repeats 15] [--clock cpu]`
Both ways in turns, one thread each; figures are medians per world and substep, the ratio with its quartiles.
"""

import argparse
import time
from unittest.mock import patch

import numpy as np
import torch
from oracle import scene
from turns import Clock, Run, in_turns, spread

from model.simulator.kernel import kernel
from model.simulator.kernel.call import Interval
from model.simulator.kernel.kernel import Kernel
from model.simulator.kernel.threads import kernel_threads
from model.simulator.simulator import Simulator
from model.simulator.system import State

SIZES = ((200, 700), (500, 5_000), (2_000, 20_000), (8_000, 120_000))
WORLDS = (2, 4, 5, 8, 9, 12, 16, 17, 24, 32)
DT, BUDGET = 5e-5, 400_000
"""A substep [s], and about how many springs a run computes in each world."""


def run_of(simulator: Simulator, worlds: int, steps: int, beside: bool) -> Run:
    """Run worlds that differ in how stiff they are."""
    stiffness = simulator.force("spring").value("stiffness").detach()
    factors = torch.linspace(0.5, 1.5, worlds).unsqueeze(1)
    many = simulator.with_force(type(simulator.force("spring"))(factors * stiffness))
    with torch.no_grad(), patch.object(kernel, "pays", lambda worlds, springs, lanes: beside):
        start, hands = many.rest_state(), many.system.controller_points
        runner = Kernel(many.dynamics(), many.integrator, torch.Size([worlds]))
        places = State(*(value.expand(worlds, -1, -1) for value in (start.positions, start.velocities)))
        interval = Interval(DT, steps, DT * steps)
        runner.advance(places, (hands, hands), interval, False)

    def run() -> torch.Tensor:
        with torch.no_grad(), kernel_threads(1):
            return runner.advance(places, (hands, hands), interval, False).positions

    return run


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--clock", choices=("wall", "cpu"), default="wall", help="what is counted")
    options = parser.parse_args()
    clock: Clock = time.perf_counter if options.clock == "wall" else time.process_time
    torch.set_num_threads(1)
    print("| points / springs | worlds | one by one [us] | side by side [us] | one by one / side by side |")
    print("|---|---|---|---|---|")
    for points, springs in SIZES:
        simulator = scene(points, springs)
        steps = max(5, BUDGET // springs)
        for worlds in WORLDS:
            both = {
                "one": run_of(simulator, worlds, steps, False),
                "beside": run_of(simulator, worlds, steps, True),
            }
            apart = (both["one"]() - both["beside"]()).abs().max()
            assert apart < 1e-5, f"they differ by {apart} m"
            times = in_turns(both, options.repeats, clock)
            ratio = spread(times["one"] / times["beside"])
            each = [1e6 * float(np.median(times[name])) / steps / worlds for name in ("one", "beside")]
            print(
                f"| {points} / {springs} | {worlds} | {each[0]:.2f} | {each[1]:.2f} | {ratio} |", flush=True
            )


if __name__ == "__main__":
    main()
