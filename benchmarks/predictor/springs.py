"""What springs of generated twins tell of their parts.

    python benchmarks/predictor/springs.py CASES...

CASES is a folder as `matphys scenes` leaves it. Of its objects: Spearman's correlation of each part's true
ln E with how many springs a point of that part has.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from model.scenes.case import Case
from model.scenes.files import describe, load_case


def springs_per_point(case: Case):
    """Of each part [K]."""
    degree = np.bincount(case.topology.springs.ravel(), minlength=len(case.topology.points))
    return [degree[case.topology.part == part].mean() for part in range(len(case.priors))]


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cases", type=Path, nargs="+")
    for folder in parser.parse_args().cases:
        cases = [load_case(folder / entry.file) for entry in describe(folder).cases]
        objects = {case.object_name: case for case in cases}.values()
        modulus = np.concatenate([case.truth.modulus for case in objects])
        density = np.concatenate([springs_per_point(case) for case in objects])
        told = spearmanr(modulus, density).statistic
        print(f"{folder}: {len(objects)} objects, {len(modulus)} parts: Spearman {told:.2f}")


if __name__ == "__main__":
    main()
