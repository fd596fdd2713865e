"""What objects are taken for by how their points lie in the first frame, and with what bears them.

    matphys scenes out/scenes --count 24 --seed 1000
    python -m benchmarks.gap.shapes out/scenes

For scenes of which a camera sees one side. A row for each kind of object: how many of them are what, what by
their points alone, and what when a sheet that is borne from below is one side of a solid.
"""

import argparse
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

from model.gap.bodies.body import shape_of
from model.gap.bodies.guess import guess_shape
from model.scenes.files import load_case, read_index


def told(folder: Path, most: int | None) -> Counter[tuple[str, str, str, str]]:
    """How many cases are of a kind, what they are, and are taken for without and with what bears them.

    Args:
        folder: Of scenes.
        most: Cases of each kind that are looked at; None: all.
    """
    counts: Counter[tuple[str, str, str, str]] = Counter()
    looked_at: Counter[str] = Counter()
    for path in read_index(folder, verify=False):
        kind = path.name.split("-")[0]
        if most is not None and looked_at[kind] >= most:
            continue
        looked_at[kind] += 1
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            case = load_case(path)
        seen = case.observation.points[0].astype(np.float64)
        seen = seen[np.isfinite(seen[:, 0])]
        alone, taken = guess_shape(seen), shape_of(case.observation, seen)
        counts[case.object_class, case.shape_class, alone, taken] += 1
    return counts


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--most", type=int, metavar="N", help="cases of each kind")
    arguments = parser.parse_args()
    counts = told(arguments.folder, arguments.most)
    print("| object | is | by its points | by what bears it | cases |\n|---|---|---|---|---|")
    for row, count in sorted(counts.items()):
        print(f"| {' | '.join(row)} | {count} |")


if __name__ == "__main__":
    main()
