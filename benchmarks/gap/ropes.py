"""Real ropes: what the diagnosis says of one clip, and how much of the gap closes on other clips.

    python -m benchmarks.gap.ropes --others 3 --out out/ropes

Reads `ropes/DLO*` of `$MATPHYS_DATA` (default `../shared/data`). Each rope is diagnosed on its first clip
with its second as the other interaction. Then the twins run open loop over the 5 s of further clips, nothing
fitted to them; the error is the mean absolute one of a coordinate, as in the data's README.
"""

import argparse
import os
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from model.gap.carried import CATALOGUE
from model.gap.diagnose import diagnose
from model.gap.hypothesis import Hypothesis
from model.gap.report.write import write_report
from model.gap.study import Study, study
from model.gap.transfer import transferred
from model.observation import read_observation
from model.simulator.divergence import SimulationDiverged
from model.types import Observation


def open_loop(fitted: Study, hypothesis: Hypothesis, values: dict[str, float], other: Observation) -> float:
    """Mean absolute error of a coordinate over the whole of another clip [m]; NaN where it diverges."""
    there = transferred(fitted, other)
    here = replace(hypothesis, twin=there.twin)
    world = here.at({name: values.get(name, quantity.start) for name, quantity in here.quantities.items()})
    try:
        with torch.no_grad():
            seen = world.sight(world.rollout(there.state).points).double().numpy()
    except SimulationDiverged:
        return float("nan")
    return float(np.nanmean(np.abs(seen - other.points)))


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--others", type=int, default=3, help="further clips of each rope")
    parser.add_argument("--ropes", nargs="*", default=["DLO1", "DLO2", "DLO3"])
    parser.add_argument("--out", type=Path, required=True, help="for the reports")
    options = parser.parse_args()
    data = Path(os.environ.get("MATPHYS_DATA", "../shared/data")) / "ropes"
    if not data.is_dir():
        print(f"{data} is absent: set MATPHYS_DATA to the folder of recordings", file=sys.stderr)
        return 2
    warnings.simplefilter("ignore")
    print(
        "| rope | verdict | probability | refit | with effect | closed | other: refit | with effect | closed "
        "| 5 s, held shape | refit | with effect | s |"
    )
    print("|---" * 13 + "|")
    for rope in options.ropes:
        clips = sorted((data / rope).glob("*.npz"))
        first, second, *rest = [read_observation(clip) for clip in clips[: 2 + options.others]]
        began = time.monotonic()
        found = diagnose(first, None, second)
        spent = time.monotonic() - began
        write_report(found.findings, options.out / rope)
        report = found.findings.report
        gap, there = report.gap, report.gap.transfer
        assert there is not None
        fitted = study(first)
        effects = tuple(CATALOGUE[record.name]() for record in found.effects)
        with_effect = Hypothesis(fitted.plain.twin, effects)
        rows = []
        for other in rest:
            held = float(np.nanmean(np.abs(other.points - other.points[:1])))
            plain = open_loop(fitted, fitted.plain, dict(fitted.base.values), other)
            added = open_loop(fitted, with_effect, dict(found.fitted or fitted.base.values), other)
            rows.append((held, plain, added))
        means = 1e3 * np.mean(rows, axis=0)
        cells = [
            rope,
            report.verdict.effect,
            f"{report.verdict.probability:.2f}",
            *(_mm(value) for value in (gap.refit, gap.with_effect)),
            _share(gap.closed_fraction),
            *(_mm(value) for value in (there.refit, there.with_effect)),
            _share(there.closed_fraction),
            *(f"{value:.1f}" for value in means),
            f"{spent:.0f}",
        ]
        print("| " + " | ".join(cells) + " |", flush=True)
    return 0


def _mm(value: float | None) -> str:
    return "–" if value is None else f"{1e3 * value:.1f}"


def _share(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


if __name__ == "__main__":
    sys.exit(main())
