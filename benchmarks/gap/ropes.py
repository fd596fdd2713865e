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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Float64
from matplotlib.figure import Figure

from model.gap.carried import CATALOGUE
from model.gap.diagnose import diagnose
from model.gap.hypothesis import Hypothesis
from model.gap.report.style import BASELINE, CEILING, EFFECT, NORMAL, REFIT, SMALL, new_figure, png, tidy
from model.gap.report.write import write_report
from model.gap.schema import GapReport
from model.gap.study import Study, study
from model.gap.transfer import transferred
from model.observation import read_observation
from model.simulator.divergence import SimulationDiverged
from model.types import Array, Observation

MODEL = (9.9e-3, 11.5e-3)
"""Of a learned and elastic-rod model trained on these ropes [m] (the data's README)."""
LOOKS = {
    "the first shape held": (BASELINE, "--"),
    "twin, refitted": (REFIT, "-"),
    "with the effect": (EFFECT, "-"),
}


def open_loop(
    fitted: Study, hypothesis: Hypothesis, values: Mapping[str, float], other: Observation
) -> Float64[Array, " T"]:
    """Mean absolute error of a coordinate in each frame of another clip [m]; NaN where it diverges."""
    there = transferred(fitted, other)
    here = replace(hypothesis, twin=there.twin)
    world = here.at({name: values.get(name, quantity.start) for name, quantity in here.quantities.items()})
    try:
        with torch.no_grad():
            seen = world.sight(world.rollout(there.state).points).double().numpy()
    except SimulationDiverged:
        return np.full(len(other.times), np.nan)
    return of_frames(seen - other.points)


def of_frames(away: Float[Array, "T N 3"]) -> Float64[Array, " T"]:
    """Mean absolute coordinate of each frame."""
    mean: Float64[Array, " T"] = np.nanmean(np.abs(away.astype(np.float64)), axis=(1, 2))
    return mean


@dataclass(frozen=True)
class Found:
    """What the diagnosis of a rope says, and how twins fare on further clips of it."""

    rope: str
    report: GapReport
    spent: float
    """[s]."""
    times: Float64[Array, " T"]
    """Of the further clips [s]."""
    errors: Mapping[str, Float64[Array, " T"]]
    """Mean absolute error of a coordinate, mean over the clips [m], by what foretold them."""

    def __str__(self) -> str:
        """A row of the table."""
        gap, there = self.report.gap, self.report.gap.transfer
        assert there is not None
        errors = [float(self.errors[name].mean()) if name in self.errors else None for name in LOOKS]
        acts = self.report.where.acts_on
        cells = [
            self.rope,
            self.report.verdict.effect,
            f"{self.report.verdict.probability:.2f}",
            ", ".join(f"{share:.1f}" for share in acts) if max(acts) > 0 else "–",
            *(_mm(value) for value in (gap.refit, gap.with_effect)),
            _share(gap.closed_fraction),
            *(_mm(value) for value in (there.refit, there.with_effect)),
            _share(there.closed_fraction),
            *(_mm(value) for value in errors),
            f"{self.spent:.0f}",
        ]
        return "| " + " | ".join(cells) + " |"


def found_of(rope: str, clips: Sequence[Observation], out: Path) -> Found:
    """Diagnose the first clip with the second, and run open loop over the others."""
    first, second, *rest = clips
    began = time.monotonic()
    found = diagnose(first, None, second)
    spent = time.monotonic() - began
    write_report(found.findings, out)
    fitted = study(first)
    effects = tuple(CATALOGUE[record.name]() for record in found.effects)
    held, plain, effect = LOOKS
    runs = {
        held: [of_frames(other.points - other.points[:1]) for other in rest],
        plain: [open_loop(fitted, fitted.plain, fitted.base.values, other) for other in rest],
    }
    if effects and found.fitted is not None:
        with_effect = Hypothesis(fitted.plain.twin, effects)
        runs[effect] = [open_loop(fitted, with_effect, found.fitted, other) for other in rest]
    errors = {name: np.mean(each, axis=0) for name, each in runs.items()}
    return Found(rope, found.findings.report, spent, rest[0].times - rest[0].times[0], errors)


def drawn(ropes: Sequence[Found]) -> Figure:
    """The errors over time, one rope beside the other."""
    figure = new_figure(2.9, 2.6 * len(ropes))
    every = figure.subplots(1, len(ropes), sharey=True, squeeze=False)[0]
    for axes, one in zip(every, ropes, strict=True):
        low, high = (1e3 * value for value in MODEL)
        axes.axhspan(low, high, color=CEILING, alpha=0.35, label="model trained on these ropes, mean")
        for name, error in one.errors.items():
            color, dashes = LOOKS[name]
            axes.plot(one.times, 1e3 * error, dashes, color=color, label=name, linewidth=1.3)
        axes.set_title(f"{one.rope}: {one.report.verdict.effect.replace('_', ' ')}", fontsize=NORMAL)
        axes.set_xlabel("seconds", fontsize=SMALL)
        axes.set_ylim(0.0)
        tidy(axes, "y")
    every[0].set_ylabel("error of a coordinate, mm", fontsize=SMALL)
    known = {
        name: line for axes in every for line, name in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        known.values(), known.keys(), fontsize=SMALL, frameon=False, loc="outside lower center", ncols=2
    )
    return figure


def main(arguments: list[str] | None = None) -> int:
    """Print the table and draw the figure."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--others", type=int, default=3, help="further clips of each rope")
    parser.add_argument("--ropes", nargs="*", default=["DLO1", "DLO2", "DLO3"])
    parser.add_argument("--out", type=Path, required=True, help="for the reports and the figure")
    options = parser.parse_args(arguments)
    if options.others < 1:
        parser.error("--others: expected at least one")
    data = Path(os.environ.get("MATPHYS_DATA", "../shared/data")) / "ropes"
    if not data.is_dir():
        print(f"{data} is absent: set MATPHYS_DATA to the folder of recordings", file=sys.stderr)
        return 2
    warnings.simplefilter("ignore")
    print(
        "| rope | verdict | probability | acts on | refit | with effect | closed | other: refit "
        "| with effect | closed | 5 s, held shape | refit | with effect | s |"
    )
    print("|---" * 14 + "|")
    ropes = []
    for rope in options.ropes:
        clips = sorted((data / rope).glob("*.npz"))[: 2 + options.others]
        ropes.append(found_of(rope, [read_observation(clip) for clip in clips], options.out / rope))
        print(ropes[-1], flush=True)
    (options.out / "ropes.png").write_bytes(png(drawn(ropes)))
    return 0


def _mm(value: float | None) -> str:
    return "–" if value is None else f"{1e3 * value:.1f}"


def _share(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


if __name__ == "__main__":
    sys.exit(main())
