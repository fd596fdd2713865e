"""How near a method comes to the twin that knows the truth, clip by clip.

    matphys evaluate CASES --priors right --no-pictures --out out/right
    python benchmarks/evaluation/floor.py CASES out/right/results.jsonl...

Of every clip in RESULTS the twin with the true parameters is rolled out as well: what is left of its error
is the lattice's, which parameters make up for in one clip at most. Means of track errors are as in the
tables. They hang on a few clips that go another way at the least difference; so the median over clips, and
the geometric mean of the ratio to the error of the true parameters in the same clip, stand beside them.
Intervals are over objects. The frames of `future` follow from a rollout of the whole clip, or from a state
that was led (`-synchronised`); so does the truth.
"""

import argparse
from pathlib import Path

import numpy as np

from model.evaluation.baselines.base import Twin
from model.evaluation.bootstrap import mean_difference
from model.evaluation.hidden import answer, seen_until_split
from model.evaluation.metrics import mean_over, track_error
from model.evaluation.records import read_records
from model.evaluation.synchronised import Led, Synchronised
from model.scenes.files import SUFFIX, describe, load_case
from model.scenes.true_parameters import true_parameters

LEAST = 1e-5
"""Errors are taken for no smaller, in ratios [m]."""


def off(case, predicted, first=1):
    """Mean track error from a frame on [m]."""
    return mean_over(track_error(answer(case)[first:], predicted[first:]))


def truths(folder, records):
    """Errors [m] of the true parameters in the clips of the records, by setting, object and clip."""
    cases = {entry.file.removesuffix(SUFFIX): folder / entry.file for entry in describe(folder).cases}
    found = {"future": {}, "future, led": {}, "unseen interaction": {}}
    fits = {(record.object_name, record.case): record for record in records}
    for (name, clip), record in fits.items():
        case = load_case(cases[clip])
        twin = Twin(case.topology, true_parameters(case))
        found["future"][name, clip] = off(case, twin.predict(case), case.split)
        led = Led(twin, seen_until_split(case)).predict(case)
        found["future, led"][name, clip] = off(case, led, case.split)
        for each in record.unseen:
            other = load_case(cases[each.case])
            found["unseen interaction"][name, f"{clip} {each.case}"] = off(other, twin.predict(other))
    return found


def errors(records, method):
    """Of a method [m], in the same keys."""
    own = [record for record in records if record.method == method]
    future = {(record.object_name, record.case): record.future["track"] for record in own}
    unseen = {
        (record.object_name, f"{record.case} {each.case}"): each.scores["track"]
        for record in own
        for each in record.unseen
    }
    led = any(record.identity.startswith(Synchronised.__name__) for record in own)
    return {"future, led" if led else "future": future, "unseen interaction": unseen}


def line(name, own, true):
    """Mean, median and ratio, as a row."""
    mean = mean_difference(dict.fromkeys(own, 0.0), own)
    logs = [{key: float(np.log(max(each[key], LEAST))) for key in own} for each in (true, own)]
    ratio = mean_difference(*logs)
    cells = [name, str(len(own))]
    cells.append(mean.scaled(1e3).shown(1))
    cells.append(f"{1e3 * float(np.median(list(own.values()))):.1f}")
    cells.append(ratio.of_each(np.exp).shown(2))
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("cases", type=Path)
    parser.add_argument("results", type=Path, nargs="+")
    given = parser.parse_args()
    results = {
        path: [record for record in read_records(path) if record.method != "hold-last"]
        for path in given.results
    }
    known = truths(given.cases, [record for records in results.values() for record in records])
    for path, records in results.items():
        methods = list(dict.fromkeys(record.method for record in records))
        for setting, true in known.items():
            print(f"\n{path}: {setting}\n")
            print("| method | clips | mean track error [mm] | median [mm] | over the truth's |")
            print("|---|---|---|---|---|")
            mine = {method: errors(records, method).get(setting, {}) for method in methods}
            asked = {key: true[key] for own in mine.values() for key in own}
            print(line("true parameters", asked, true))
            for method, own in mine.items():
                if own:
                    print(line(method, own, true))


if __name__ == "__main__":
    main()
