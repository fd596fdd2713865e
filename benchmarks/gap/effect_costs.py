"""How long a rollout takes with each effect, beside the plain twin's.

In processor time of one core, so that other work on the machine matters less; the plain twin is as it was
guessed from the observation, every effect at its start. Run: `python -m benchmarks.gap.effect_costs X.npz`.
"""

import argparse
import time
import warnings
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.simulator.turns import Run, in_turns
from model.gap.bodies.body import body_of
from model.gap.effects import ALL_EFFECTS
from model.gap.noise import noise_of
from model.gap.plain import PlainTwin
from model.gap.study import misfit_of
from model.observation import read_observation
from model.one_thread import one_thread
from model.simulator.kernel.threads import kernel_threads

WORLDS = 16
"""Rolled out at once, two vectors of eight."""
TIMES = 3
"""Measured, of which the quickest counts."""


@dataclass(frozen=True)
class Cost:
    """Of one effect."""

    name: str
    seconds: float
    """For all worlds, of one core."""
    substeps: int
    """Per frame."""


def costs(observation: Path) -> list[Cost]:
    """Of the plain twin, then of every effect that can act there."""
    seen = read_observation(observation)
    twin = PlainTwin.of(body_of(seen), seen)
    plain, start = misfit_of(twin, seen, noise_of(seen))
    world = plain.hypothesis.at(start)
    effects = [effect for effect in (every() for every in ALL_EFFECTS) if effect.unable(world) is None]
    misfits = {"plain": plain} | {
        effect.name: plain.of(plain.hypothesis.with_effect(effect)) for effect in effects
    }
    worlds = {name: np.repeat(misfit.coordinates.starts[None], WORLDS, 0) for name, misfit in misfits.items()}
    runs: dict[str, Run] = {name: partial(misfit, worlds[name]) for name, misfit in misfits.items()}
    seconds = in_turns(runs, TIMES, time.process_time)
    return [
        Cost(name, float(seconds[name].min()), misfit.needs(worlds[name][0]))
        for name, misfit in misfits.items()
    ]


def main(arguments: list[str] | None = None) -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("observation", type=Path)
    options = parser.parse_args(arguments)
    warnings.simplefilter("ignore")
    with kernel_threads(1), one_thread():
        found = costs(options.observation)
    print(
        f"| with | s for {WORLDS} worlds | substeps per frame | times the plain twin's |\n|---|---|---|---|"
    )
    for one in found:
        print(f"| {one.name} | {one.seconds:.2f} | {one.substeps} | {one.seconds / found[0].seconds:.2f} |")


if __name__ == "__main__":
    main()
