"""What springs of generated twins tell of their parts, and how stiff those across a border are taken to be.

    python benchmarks/predictor/springs.py CASES...

CASES is a folder as `matphys scenes` leaves it. Of its objects: Spearman's correlation of each part's true
ln E with how many springs a point of that part has. Of its clips whose parts differ: the share of springs
across a border, and how much higher the network's weighted mean of the two true moduli is than the world's,
which is the mean of their logarithms.
"""

import argparse
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from model.predictor.lattice import lattice_stiffness
from model.scenes.case import Case
from model.scenes.files import describe, load_case
from model.scenes.world.truth import part_stiffness, part_volumes


def springs_per_point(case: Case):
    """Of each part [K]."""
    degree = np.bincount(case.topology.springs.ravel(), minlength=len(case.topology.points))
    return [degree[case.topology.part == part].mean() for part in range(len(case.priors))]


def borders(case: Case):
    """Which springs lie across one [E], and how much stiffer than the world the network has each [E]."""
    density = np.array([prior.properties["density"].mean for prior in case.priors])
    shape = (part_volumes(case.topology, density), case.shape_class)
    between = lattice_stiffness(case.topology, case.truth.modulus, *shape)
    part = case.topology.part[case.topology.springs]
    return part[:, 0] != part[:, 1], np.log(
        between / part_stiffness(case.topology, case.truth.modulus, *shape)
    )


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
        met = [(across, above) for across, above in map(borders, cases) if across.any()]
        share = np.mean(np.concatenate([across for across, _ in met]))
        above = np.mean([above[across].mean() for across, above in met])
        print(f"{len(met)} clips with borders: {share:.1%} of their springs, {above:+.2f} of ln E")


if __name__ == "__main__":
    main()
