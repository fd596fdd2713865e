"""Runs measured in turns, so that a busy machine slows all of them alike."""

from collections.abc import Callable

import numpy as np

Run = Callable[[], object]
Clock = Callable[[], float]
"""Seconds."""


def in_turns(runs: dict[str, Run], repeats: int, clock: Clock) -> dict[str, np.ndarray]:
    """Seconds of each run, in each of the rounds."""
    for run in runs.values():
        run()
    seconds = {name: np.empty(repeats) for name in runs}
    for turn in range(repeats):
        for name, run in runs.items():
            began = clock()
            run()
            seconds[name][turn] = clock() - began
    return seconds


def spread(values: np.ndarray) -> str:
    """Median and quartiles."""
    low, middle, high = np.percentile(values, (25, 50, 75))
    return f"{middle:.1f} ({low:.1f}…{high:.1f})"
