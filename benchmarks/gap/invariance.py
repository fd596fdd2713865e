"""Does the diagnosis say the same of the same observation turned, shifted, reordered or seen at fewer points?

    python -m benchmarks.reality.generate --split dev --count 60 --seed 0 --out out/worlds/dev
    python -m benchmarks.gap.invariance out/worlds/dev --count 20 --transfer --out out/invariance

With `--transfer` the other recording of a world (NAME.transfer.npz) is given along, changed in the same way.
What `--out` holds already, of the same files, is not diagnosed again: give a new folder after a change of the
code. Two probabilities of one row are compared for every effect, and for the verdict where it is the same.
"""

import argparse
import json
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from model.crew import crew
from model.errors import InputError
from model.formats.files import replacing
from model.gap.benchmark.predict import digest, transfer_of, worlds_of
from model.gap.diagnose import diagnose
from model.gap.registration import Motion, moved
from model.gap.schema import GapReport
from model.gap.taken import Taken
from model.observation import read_observation
from model.types import Array, Observation

TURN = np.deg2rad(37.0)
"""About the vertical: no symmetry of a grid of probes."""
SHIFT, LIFT = (1.3, -0.7, 0.0), 0.45
"""[m]."""
UNCHANGED, REFUSED = "unchanged", "refused"


def permuted(seen: Observation) -> Observation:
    """Its points in another order, the same one for all recordings of as many points."""
    return _chosen(seen, np.random.default_rng(0).permutation(seen.points.shape[1]))


def halved(seen: Observation) -> Observation:
    """Every other point."""
    return _chosen(seen, np.arange(0, seen.points.shape[1], 2))


VARIANTS: Mapping[str, Callable[[Observation], Observation]] = {
    UNCHANGED: lambda seen: seen,
    "turned": lambda seen: moved(seen, Motion(_about_the_vertical(TURN), np.zeros(3))),
    "shifted": lambda seen: moved(seen, Motion(np.eye(3), np.array(SHIFT))),
    "lifted": lambda seen: moved(seen, Motion(np.eye(3), np.array([*SHIFT[:2], LIFT]))),
    "permuted": permuted,
    "halved": halved,
}


@dataclass(frozen=True)
class Said:
    """What a diagnosis says of one variant."""

    verdict: str
    """`refused`: nothing, the file cannot be used."""
    probability: float
    effects: dict[str, float]
    """Probability of each effect of the catalogue."""
    seconds: float

    @classmethod
    def of(cls, report: GapReport, seconds: float) -> "Said":
        """What of a report is compared."""
        chances: dict[str, float] = {finding.name: finding.probability for finding in report.effects}
        return cls(report.verdict.effect, report.verdict.probability, chances, seconds)


@dataclass(frozen=True)
class Job:
    """One variant of one world."""

    world: Path
    variant: str
    transfer: bool
    kept: Path


def jobs_of(worlds: Path, count: int, transfer: bool, out: Path) -> list[Job]:
    """All variants of the first worlds, by name.

    Raises:
        InputError: there are no worlds, or one of them has no other recording.
    """
    found = worlds_of(worlds)[:count]
    for world in found if transfer else []:
        if not transfer_of(world).is_file():
            raise InputError(
                f"{transfer_of(world)}: expected the other recording of {world.name}, found none"
            )
    folder = out / ("with transfer" if transfer else "alone")
    return [
        Job(world, variant, transfer, folder / f"{world.stem}.{variant}.json")
        for world in found
        for variant in VARIANTS
    ]


def said(job: Job) -> Said:
    """Of one variant, by a diagnosis or by what was kept of one."""
    files = [job.world, *([transfer_of(job.world)] if job.transfer else [])]
    same = digest(*files)
    if job.kept.is_file():
        kept = json.loads(job.kept.read_bytes())
        if kept.pop("sha256") == same:
            return Said(**kept)
    change = VARIANTS[job.variant]
    began = time.monotonic()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        seen, *others = (change(read_observation(path)) for path in files)
        try:
            taken = Taken.of(seen, job.world.name)
            transfer = taken.other(others[0], files[1].name) if others else None
            report = diagnose(taken.observation, transfer=transfer).findings.report
            result = Said.of(report, time.monotonic() - began)
        except InputError:
            result = Said(REFUSED, 1.0, {}, time.monotonic() - began)
    with replacing(job.kept) as temporary:
        temporary.write_text(json.dumps({"sha256": same, **asdict(result)}))
    return result


def change_of(one: Said, other: Said) -> float:
    """The largest difference of a probability."""
    apart = [abs(chance - other.effects.get(name, 0.0)) for name, chance in one.effects.items()]
    if one.verdict == other.verdict:
        apart.append(abs(one.probability - other.probability))
    return max(apart, default=0.0)


def table(results: Mapping[tuple[str, str], Said]) -> str:
    """In Markdown: a row for each world, and what all of a variant have in common with the unchanged ones.

    Args:
        results: By world and variant.
    """
    worlds = list(dict.fromkeys(world for world, _ in results))
    lines = [f"| world | {' | '.join(VARIANTS)} | largest change |", "|---" * (len(VARIANTS) + 2) + "|"]
    for world in worlds:
        first = results[world, UNCHANGED]
        each = {variant: results[world, variant] for variant in VARIANTS}
        cells = [_cell(one, first) for one in each.values()]
        most = max(change_of(first, one) for one in each.values())
        lines.append(f"| {world} | {' | '.join(cells)} | {most:.2f} |")
    pairs = {variant: [(results[w, UNCHANGED], results[w, variant]) for w in worlds] for variant in VARIANTS}
    same = [float(np.mean([a.verdict == b.verdict for a, b in pairs[name]])) for name in VARIANTS]
    most_of = [max(change_of(a, b) for a, b in pairs[name]) for name in VARIANTS]
    middle = [float(np.median([change_of(a, b) for a, b in pairs[name]])) for name in VARIANTS]
    lines.append(f"| same verdict | {' | '.join(f'{value:.2f}' for value in same)} | {min(same):.2f} |")
    lines.append(f"| median change | {' | '.join(f'{value:.2f}' for value in middle)} | {max(middle):.2f} |")
    lines.append(
        f"| largest change | {' | '.join(f'{value:.2f}' for value in most_of)} | {max(most_of):.2f} |"
    )
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("worlds", type=Path)
    parser.add_argument("--count", type=int, default=20, help="worlds, the first by name")
    parser.add_argument("--out", type=Path, required=True, help="keeps what was said")
    parser.add_argument("--transfer", action="store_true", help="give the other recording along")
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args(arguments)
    try:
        jobs = jobs_of(options.worlds, options.count, options.transfer, options.out)
    except InputError as error:
        parser.error(str(error))
    results = {}
    for done, (job, one) in enumerate(_each(jobs, options.workers), 1):
        results[job.world.stem, job.variant] = one
        what = f"{job.world.stem} {job.variant}: {one.verdict} {one.probability:.2f}"
        print(f"{done} of {len(jobs)}: {what} ({one.seconds:.0f} s)", file=sys.stderr, flush=True)
    print(table({(job.world.stem, job.variant): results[job.world.stem, job.variant] for job in jobs}))
    return 0


def _each(jobs: Sequence[Job], workers: int) -> Iterator[tuple[Job, Said]]:
    if workers == 1:
        yield from ((job, said(job)) for job in jobs)
        return
    with crew(workers) as pool:
        begun = {pool.submit(said, job): job for job in jobs}
        yield from ((begun[one], one.result()) for one in as_completed(begun))


def _about_the_vertical(angle: float) -> Array:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _cell(one: Said, first: Said) -> str:
    mark = "" if one.verdict == first.verdict else "**"
    return f"{mark}{one.verdict}{mark} {one.probability:.2f}"


def _chosen(seen: Observation, points: Array) -> Observation:
    colors = None if seen.colors is None else seen.colors[points]
    parts = None if seen.parts is None else seen.parts[points]
    return replace(seen, points=seen.points[:, points], colors=colors, parts=parts)


if __name__ == "__main__":
    sys.exit(main())
