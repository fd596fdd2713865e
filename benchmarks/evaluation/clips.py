"""What one clip weighs in an evaluation: track error of the future with it and without it.

    python benchmarks/evaluation/clips.py RESULTS.jsonl... --without CASE

RESULTS is what `matphys evaluate` leaves in its folder; CASE the name of a clip, as it stands in there.
Methods are compared with the first one of the file in the same clips, intervals are as in the tables.
"""

import argparse
from pathlib import Path

from model.evaluation.bootstrap import Interval, mean_difference
from model.evaluation.records import Record, read_records


def futures(records: list[Record], method: str, left_out: str | None):
    """Track error by object and clip [mm]."""
    kept = [record for record in records if record.method == method and record.case != left_out]
    return {(record.object_name, record.case): 1e3 * record.future["track"] for record in kept}


def mean(own: dict[tuple[str, str], float]) -> Interval | None:
    """Over objects."""
    return mean_difference(dict.fromkeys(own, 0.0), own)


def said(figure: Interval | None) -> str:
    """As in a table."""
    return "–" if figure is None else figure.shown(1)


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("results", type=Path, nargs="+")
    parser.add_argument("--without", required=True, metavar="CASE")
    given = parser.parse_args()
    for path in given.results:
        records = list(read_records(path))
        methods = list(dict.fromkeys(record.method for record in records))
        print(f"{path}: future, track [mm]")
        print("| method | clips | mean | worse by | mean without | worse by | that clip |")
        print("|---|---|---|---|---|---|---|")
        for method in methods:
            cells = [method, str(len(futures(records, method, None)))]
            for left_out in (None, given.without):
                first, own = (futures(records, name, left_out) for name in (methods[0], method))
                cells += [said(mean(own)), said(mean_difference(first, own))]
            every = futures(records, method, None).items()
            cells.append(", ".join(f"{error:.1f}" for (_, case), error in every if case == given.without))
            print(f"| {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
