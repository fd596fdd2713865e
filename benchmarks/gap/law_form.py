"""Whether any strength of an effect explains a recording: its law against what really moved.

    python -m benchmarks.gap.law_form anisotropy out/worlds/dev/a24c688723.npz --looks 600

Where an effect is known to be at work, and no values of its quantities bring the twin near the noise, the
form of its law is wrong, or what the twin is built of cannot express it. A diagnosis looks at few places and
has several effects to fit; this looks at many of one, spread evenly over the effect's bounds and around the
plain twin's stiffness, damping and drag, and follows the best. Prints a row for each recording: what the
fitted twin leaves unexplained over the noise (mean square) without the effect and with it, and its values.
"""

import argparse
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float64
from scipy.stats import qmc

from model.gap.carried import CATALOGUE
from model.gap.estimate import Estimate, estimate
from model.gap.hypothesis import Hypothesis
from model.gap.misfit import Misfit
from model.gap.search import known
from model.gap.study import STEPS, Study, quarter_of, study
from model.observation import read_observation
from model.schema import EffectName
from model.types import Array

HEADER = "| recording | shape | noise [mm] | left | with the effect | values |"
FREE = ("stiffness", "damping", "drag_rate")
"""Parameters of the twin that are looked around as well: it may have made up for the effect with them."""
AROUND = (-1.0, 1.5)
"""How far, in powers of e: what it made up for has mostly softened it."""
FOLLOWED = 3


def looked_at(base: Study, misfit: Misfit, looks: int) -> Float64[Array, "s d"]:
    """Places spread over the bounds of the effect and around the plain twin's parameters."""
    coordinates = misfit.coordinates
    names, (low, high) = coordinates.names, coordinates.bounds
    (usual,) = known(misfit, base.base.values, [{}])
    middle = coordinates.vector(usual)
    shares = qmc.Halton(len(names), scramble=False).random(looks + 1)[1:]
    own = np.array(["." in name for name in names])
    free = np.array([name in FREE for name in names])
    begin = np.where(own, low, np.where(free, middle + AROUND[0], middle))
    end = np.where(own, high, np.where(free, middle + AROUND[1], middle))
    return np.clip(begin + shares * (end - begin), low, high)


def best_of(base: Study, name: EffectName, looks: int) -> Estimate:
    """The best fit of the twin with the effect.

    Raises:
        SystemExit: the effect cannot act in this recording.
    """
    hypothesis = Hypothesis(base.plain.twin, (CATALOGUE[name](),))
    reason = hypothesis.effects[0].unable(base.plain.at(base.base.values))
    if reason is not None:
        raise SystemExit(f"{name} cannot act in this recording: {reason}")
    misfit = base.misfit.of(hypothesis)
    places = looked_at(base, misfit, looks)
    order = np.argsort((misfit(places) ** 2).mean(1), kind="stable")
    found = []
    for i in order[:FOLLOWED]:
        misfit.settle()
        found.append(estimate(misfit, places[i][None], STEPS, quarter_of(misfit), slopes=False))
    return min(found, key=lambda one: one.cost)


def row(path: Path, name: EffectName, looks: int) -> str:
    """What a recording says of the effect."""
    base = study(read_observation(path))
    found = best_of(base, name, looks)
    values = ", ".join(
        f"{key.split('.')[1]} {value:.3g}" for key, value in found.values.items() if "." in key
    )
    shape, noise = base.plain.twin.body.shape, 1e3 * base.misfit.noise
    return f"| {path.stem} | {shape} | {noise:.2f} | {base.base.cost:.1f} | {found.cost:.1f} | {values} |"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row for each recording."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("effect", choices=tuple(CATALOGUE))
    parser.add_argument("recordings", type=Path, nargs="+", help="observations (.npz)")
    parser.add_argument("--looks", type=int, default=400, help="places that are looked at")
    options = parser.parse_args(arguments)
    warnings.simplefilter("ignore")
    torch.set_num_threads(1)
    print(f"{HEADER}\n{'|---' * (HEADER.count('|') - 1)}|", flush=True)
    for path in options.recordings:
        print(row(path, options.effect, options.looks), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
