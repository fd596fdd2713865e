"""How far a rounding leads a twin astray, with and without the hinges that let zigzags die out.

    python -m benchmarks.reality.generate --split dev --count 60 --seed 0 --out out/worlds/dev
    python -m benchmarks.gap.roundings out/worlds/dev

Of healthy development worlds of ropes and sheets: the plain twins of a recording, and of the same one moved
by a metre, differ by roundings alone (1e-7 m). They are led through the frames that fits see, with the
parameters at which a fit may begin. How far they are apart at most, in millimetres, in the middle of the ten
that leave least; and how much the best of all leaves, as a mean square over that of the noise.
"""

import sys
from dataclasses import replace

import numpy as np

from benchmarks.gap.development import healthy_worlds
from model.gap.bodies.body import body_of
from model.gap.misfit import Misfit
from model.gap.noise import noise_of
from model.gap.plain import PlainTwin
from model.gap.registration import Motion, moved
from model.gap.study import misfit_of, starts_of
from model.observation import read_observation
from model.types import Array, Observation

SHIFT = Motion(np.eye(3), np.array([1.3, -0.7, 0.0]))
BEST = 10


def unfitted(observation: Observation, calm: bool) -> tuple[Misfit, dict[str, float]]:
    """The misfit of the plain twin before any fit, and what it starts with."""
    twin = PlainTwin.of(body_of(observation), observation)
    if not calm:
        twin = replace(twin, matter=replace(twin.matter, bending_decay=0.0))
    return misfit_of(twin, observation, noise_of(observation))


def astray(observation: Observation, calm: bool) -> tuple[float, float]:
    """How far twins are apart [m] that differ by roundings, and what the best leaves."""
    one, start = unfitted(observation, calm)
    other, _ = unfitted(moved(observation, SHIFT), calm)
    places: Array = starts_of(one, start)
    here, there = one(places), other(places)
    left = (here**2).mean(1)
    best = np.argsort(left)[:BEST]
    apart = np.abs(here[best] - there[best]).max(1) * one.noise
    return float(np.median(apart)), float(left.min())


def main(arguments: list[str] | None = None) -> int:
    """Print a table."""
    worlds = healthy_worlds(__doc__, arguments)
    print("| world | object | interaction | apart mm, without | with | left, without | with |")
    print("|---" * 7 + "|")
    for folder, label in worlds:
        if label["kind"] == "solid":
            continue
        observation = read_observation(folder / f"{label['world']}.npz")
        (far, much), (near, little) = (astray(observation, calm) for calm in (False, True))
        what = f"{label['world']} | {label['kind']} | {label['interaction']}"
        print(f"| {what} | {1e3 * far:.2g} | {1e3 * near:.2g} | {much:.1f} | {little:.1f} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
