"""How far a rounding leads a twin astray, with and without the hinges that let zigzags die out.

    python -m benchmarks.reality.generate --split dev --count 60 --seed 0 --out out/worlds/dev
    python -m benchmarks.gap.roundings out/worlds/dev

Of healthy development worlds of ropes and sheets: the plain twins of a recording, and of the same one moved
by a metre, differ by roundings alone (1e-7 m). They are led through the frames that fits see, with the
parameters at which a fit may begin. How far they are apart at most, in millimetres, in the middle of the ten
that leave least; and how much the best of all leaves, as a mean square over that of the noise.
"""

import argparse
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from model.gap.benchmark.labels import PLAIN, open_labels
from model.gap.bodies.body import body_of
from model.gap.estimate import Misfit, Span
from model.gap.hypothesis import Hypothesis
from model.gap.noise import noise_of
from model.gap.observer import Observer
from model.gap.plain import PlainTwin
from model.gap.registration import Motion, moved
from model.gap.study import HELD_OUT, LEAST_NOISE, PATIENCE, starts_of
from model.observation import read_observation
from model.types import Array, Observation

SHIFT = Motion(np.eye(3), np.array([1.3, -0.7, 0.0]))
BEST = 10


def misfit_of(observation: Observation, calm: bool) -> tuple[Misfit, dict[str, float]]:
    """Of the plain twin before any fit, and what it starts with."""
    twin = PlainTwin.of(body_of(observation), observation)
    if not calm:
        twin = replace(twin, matter=replace(twin.matter, bending_decay=0.0))
    plain = Hypothesis(twin)
    start = {name: quantity.start for name, quantity in plain.quantities.items()}
    last = round((1.0 - HELD_OUT) * len(observation.times)) - 1
    observer = Observer(observation, plain.at(start), PATIENCE)
    return Misfit(plain, observer, Span(0, last), max(noise_of(observation), LEAST_NOISE)), start


def astray(observation: Observation, calm: bool) -> tuple[float, float]:
    """How far twins are apart [m] that differ by roundings, and what the best leaves."""
    one, start = misfit_of(observation, calm)
    other, _ = misfit_of(moved(observation, SHIFT), calm)
    places: Array = starts_of(one, start)
    here, there = one(places), other(places)
    left = (here**2).mean(1)
    best = np.argsort(left)[:BEST]
    apart = np.abs(here[best] - there[best]).max(1) * one.noise
    return float(np.median(apart)), float(left.min())


def main(arguments: list[str] | None = None) -> int:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("worlds", type=Path)
    options = parser.parse_args(arguments)
    if not (options.worlds / PLAIN).is_file():
        parser.error(f"{options.worlds}: expected development worlds with {PLAIN}")
    warnings.simplefilter("ignore")
    torch.set_num_threads(1)
    print("| world | object | interaction | apart mm, without | with | left, without | with |")
    print("|---" * 7 + "|")
    for label in open_labels(options.worlds):
        if label["category"] != "null" or label["kind"] == "solid":
            continue
        observation = read_observation(options.worlds / f"{label['world']}.npz")
        (far, much), (near, little) = (astray(observation, calm) for calm in (False, True))
        what = f"{label['world']} | {label['kind']} | {label['interaction']}"
        print(f"| {what} | {1e3 * far:.2g} | {1e3 * near:.2g} | {much:.1f} | {little:.1f} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
