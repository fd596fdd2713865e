"""What density alone says of stiffness: rank correlations of the parts' moduli, as such and over density.

    python -m benchmarks.evaluation.density CASES RESULTS.jsonl...

CASES is the folder that was evaluated; RESULTS is what `matphys evaluate` leaves in its folder. Methods are
told the density, whatever else the prior says. Dense stuffs are stiff in the procedural world, so that it
tells much of E; of E over density, all that a motion under gravity shows, it tells nothing directly.
"""

import argparse
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float64
from scipy.stats import spearmanr

from model.evaluation.bootstrap import interval
from model.evaluation.records import read_records
from model.scenes.files import load_folder
from model.types import Array

Parts = dict[str, Float64[Array, "K 3"]]
"""By object: of each part the logarithms of true modulus, estimate and density."""


def parts_of(results: Path, densities: dict[str, list[float]]) -> dict[str, Parts]:
    """By method: of the first clip that each object was learned from."""
    found: dict[str, Parts] = defaultdict(dict)
    for record in read_records(results):
        rows = [
            (part.log_truth, part.log_estimate, np.log(densities[record.object_name][part.part]))
            for part in record.parts
            if part.log_truth is not None
        ]
        if rows:
            found[record.method].setdefault(record.object_name, np.array(rows))
    return found


def correlation(objects: Sequence[Float64[Array, "K 3"]], one: str, other: str) -> float:
    """Of ranks; of `E`, `estimate`, `density`, or the first two over density."""
    truth, estimate, density = np.concatenate(list(objects)).T
    columns = {
        "E": truth,
        "estimate": estimate,
        "density": density,
        "E/density": truth - density,
        "estimate/density": estimate - density,
    }
    return float(spearmanr(columns[one], columns[other]).statistic)


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cases", type=Path)
    parser.add_argument("results", type=Path, nargs="+")
    given = parser.parse_args()
    densities = {
        case.object_name: [prior.properties["density"].mean for prior in case.priors]
        for case in load_folder(given.cases)
    }
    pairs = {
        "density with E": ("E", "density"),
        "E": ("E", "estimate"),
        "E/density": ("E/density", "estimate/density"),
    }
    for path in given.results:
        print(f"{path}: rank correlation\n| method | {' | '.join(pairs)} |\n|---|{'---|' * len(pairs)}")
        for method, objects in parts_of(path, densities).items():
            figures = (
                interval(list(objects.values()), lambda drawn, pair=pair: correlation(drawn, *pair))
                for pair in pairs.values()
            )
            cells = ("–" if figure is None else figure.shown(2) for figure in figures)
            print(f"| {method} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
