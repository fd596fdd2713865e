"""The withheld check: diagnose a folder of worlds, seal what was said, then open the labels and score."""

import statistics
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from model.gap.benchmark.document import Run
from model.gap.benchmark.labels import check_labels, open_labels
from model.gap.benchmark.outcomes import Outcome, outcomes
from model.gap.benchmark.predict import PREDICTIONS, Diagnose, Prediction, digest, predict
from model.gap.benchmark.table import Table, table
from model.progress import StageReport

BROKEN = 0.1
"""Share of the worlds; where more break, something is wrong with us, and the labels stay closed."""


@dataclass(frozen=True)
class Benchmark:
    """The result of a check."""

    run: Run
    table: Table
    worlds: tuple[Outcome, ...]
    refused: dict[str, str]
    """Why, by world."""


def benchmark(
    worlds: Path,
    out: Path,
    diagnose: Diagnose,
    *,
    workers: int = 1,
    title: str = "Worlds",
    command: str = "matphys gap-benchmark",
    progress: StageReport | None = None,
) -> Benchmark:
    """Diagnose every world, write and hash `predictions.json`, and only then open the labels.

    Args:
        worlds: Holds NAME.npz and NAME.transfer.npz, and `labels.json` or `labels.sealed`.
        out: Holds what was diagnosed, so that a check that was stopped goes on; made if missing.
        diagnose: `model.gap.diagnose.diagnose`.
        workers: Processes.
        title: What the run is called in tables.
        command: How it was called, for the page.
        progress: Told the share that is done.

    Returns:
        The scores and what they are of.

    Raises:
        InputError: there are no worlds or no labels, or they do not belong together.
        RuntimeError: so many diagnoses broke that labels would be opened for nothing.
    """
    check_labels(worlds)
    said = predict(worlds, out, diagnose, workers, progress)
    _whole(said)
    sealed = digest(out / PREDICTIONS)
    joined = outcomes(said, open_labels(worlds, out / PREDICTIONS))
    run = Run(
        title=title,
        command=command,
        date=time.strftime("%Y-%m-%d", time.gmtime()),
        folder=worlds.name,
        digest=sealed,
        seconds=statistics.median(each.seconds for each in said.values()),
    )
    refused = {name: each.refused for name, each in said.items() if each.report is None}
    return Benchmark(run, table(joined), joined, refused)


def _whole(said: Mapping[str, Prediction]) -> None:
    broken = [f"{name}: {each.refused}" for name, each in said.items() if each.broke]
    if len(broken) > BROKEN * len(said):
        raise RuntimeError(f"{len(broken)} of {len(said)} diagnoses broke, labels stay closed; {broken[0]}")
