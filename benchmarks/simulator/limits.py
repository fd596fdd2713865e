"""What bounds a substep of the kernel forward: memory streamed, its own accesses, its arithmetic."""

import ctypes
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch
from oracle import scene
from turns import Clock, Run, in_turns, spread

from model.simulator.kernel import build
from model.simulator.kernel.call import state_rows
from model.simulator.kernel.emit import kernel_source
from model.simulator.kernel.graph import ordered
from model.simulator.kernel.layout import LANES, cut, lay_out
from model.simulator.kernel.terms import Terms
from model.simulator.simulator import Simulator

STEPS = 100
"""Substeps of one run."""
ENGINE_FLOPS = 34
"""Of a spring besides its law: differences 6, square 5, inverse and length 7, rate 6, force 4, sums 6."""
FUSED = 12 * LANES * 2
"""Of one round of `fuse`."""
ROUNDS = 1_000_000


class Limits:
    """The limits of one simulator's substep, as runs of `STEPS` of them.

    Args:
        simulator: In float32, with springs.
    """

    def __init__(self, simulator: Simulator) -> None:
        """See the class."""
        terms = Terms(simulator.dynamics(), simulator.integrator, torch.Size(()))
        text = kernel_source(terms.groups, terms.corners, terms.ground, torch.float32)
        self._library = build.load(text + Path(__file__).with_name("limits.cpp").read_text())
        edges = simulator.system.edges
        self._layout, slots = lay_out(edges), lay_out(edges).springs
        self._slots, self._rows = slots, torch.zeros(2, state_rows(self._layout), LANES)
        self._values = torch.ones(2, len(slots.offset))
        self._points = torch.ones(5, len(self._layout.point))  # mobility, drag, friction, restitution, height
        self._sums = torch.zeros(cut(edges).room * LANES, LANES // 2)
        law = [node for node in ordered([terms.groups["springs"].tension]) if node.arguments]
        self.flops = (ENGINE_FLOPS + len(law)) * len(slots.offset)
        """Of a substep, of the slots that only fill up too."""
        self._read: Sequence[torch.Tensor] = (slots.offset, self._values, self._rows[0], self._points)
        self.streamed = (
            sum(4 * each.numel() for each in (*self._read, self._rows[1])) + 4 * 4 * self._sums.numel()
        )
        """Bytes that a substep reads and writes if it touches every number as seldom as it can."""

    def stream(self) -> None:
        """All arrays, from their beginnings to their ends; the sums twice."""
        places = np.array([each.data_ptr() for each in self._read])
        sizes = np.array([each.numel() for each in self._read])
        read = (places.ctypes.data, sizes.ctypes.data)
        self._library.stream(
            *map(ctypes.c_void_p, read),
            ctypes.c_int64(len(places)),
            ctypes.c_void_p(self._sums.data_ptr()),
            ctypes.c_int64(self._sums.numel()),
            ctypes.c_void_p(self._rows[1].data_ptr()),
            ctypes.c_int64(self._rows[1].numel()),
            ctypes.c_int64(STEPS),
        )

    def touch(self) -> None:
        """The kernel's own loads and stores."""
        read = (
            self._rows[0],
            self._rows[1],
            self._sums,
            self._slots.offset,
            *self._values,
            self._slots.start,
        )
        self._library.touch_all(
            *(ctypes.c_void_p(each.data_ptr()) for each in read),
            ctypes.c_int64(self._layout.slices),
            ctypes.c_int64(STEPS),
        )

    def calculate(self) -> None:
        """The kernel's own arithmetic."""
        self._library.calculate(ctypes.c_int64(self._slots.rows), ctypes.c_int64(STEPS))

    def fuse(self) -> None:
        """As many operations as the processor can do."""
        self._library.fuse(ctypes.c_int64(ROUNDS))


def limit_table(
    sizes: Sequence[tuple[int, int]], forward: Callable[[Simulator], Run], repeats: int, clock: Clock
) -> None:
    """How near the kernel is to each; `forward` makes a run of `STEPS` substeps."""
    torch.set_num_threads(1)
    print("\n## forward, against what bounds it, each alone [us per substep]; share of the kernel's time\n")
    bounds = {"stream": "streamed once", "touch": "its loads and stores", "calculate": "its arithmetic"}
    heads = [*bounds.values(), "FLOP at the FMA peak"]
    print(f"| points / springs | kernel | MB | GB/s | {' | '.join(f'{h} | share [%]' for h in heads)} |")
    print("|---" * (4 + 2 * len(heads)) + "|")
    for points, springs in sizes:
        simulator = scene(points, springs)
        limits = Limits(simulator)
        runs: dict[str, Run] = {name: getattr(limits, name) for name in (*bounds, "fuse")}
        seconds = in_turns({**runs, "kernel": forward(simulator)}, repeats, clock)
        micro = {name: 1e6 / STEPS * value for name, value in seconds.items()}
        micro["fuse"] = 1e6 * limits.flops * seconds["fuse"] / (FUSED * ROUNDS)
        middle = {name: float(np.median(value)) for name, value in micro.items()}
        cells = [f"{middle['kernel']:.0f}", f"{limits.streamed / 1e6:.2f}"]
        cells.append(f"{limits.streamed / middle['stream'] / 1e3:.0f}")
        for name in (*bounds, "fuse"):
            cells += [f"{middle[name]:.1f}", spread(100 * micro[name] / micro["kernel"])]
        print(f"| {points} / {springs} | " + " | ".join(cells) + " |")
    peak = FUSED * ROUNDS / float(np.median(seconds["fuse"])) / 1e9
    print(f"\nFMA peak: {peak:.0f} GFLOP/s.")
