"""Every method on every case: in several processes, resumable, one line of JSON each."""

import fcntl
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from model.crew import crew
from model.errors import InputError
from model.evaluation.baselines.base import Method
from model.evaluation.fits import Fits, fitter
from model.evaluation.lpips import Lpips
from model.evaluation.pictures import Pictures
from model.evaluation.protocol import Setting, Task, judge
from model.evaluation.records import Record, line, read_records, write_records
from model.progress import StageReport
from model.scenes.case import Case
from model.scenes.files import INDEX, IndexEntry, describe, load_case, read_index
from model.scenes.priors import Opinion, with_priors

RESULTS, LOCK = "results.jsonl", "results.lock"
VERSION = 1
"""Counted up when metrics or settings change: kept results are then measured again."""


@dataclass(frozen=True)
class Plan:
    """What is measured."""

    data: Path
    """A folder of cases with its index."""
    methods: Mapping[str, Method]
    """By name, in the order of tables."""
    settings: tuple[Setting, ...]
    opinion: Opinion | None = None
    """What the methods are told of materials; None: what the cases say."""
    fits: int = 1
    """Interactions of each object that are learned from."""
    limit: int | None = None
    """Objects, evenly from all classes; None: all."""
    pictures: bool = True
    lpips: Path | None = None
    """A folder of weights."""
    seed: int = 0
    """Of which interactions are learned from, and of the priors."""


@dataclass(frozen=True)
class _Job:
    key: str
    name: str
    method: Method
    case: Path
    others: tuple[Path, ...]
    source: str
    plan: Plan


def evaluate(plan: Plan, out: Path, workers: int = 1, progress: StageReport | None = None) -> list[Record]:
    """Measure whatever has not been measured yet.

    Args:
        plan: What.
        out: Folder of `results.jsonl`; what is there already of the same index, cases, methods and settings
            is kept, unless it failed. Made if missing.
        workers: Processes.
        progress: Told the share that is done.

    Returns:
        The records of the plan, in its order.

    Raises:
        InputError: there are no cases, or fewer than the settings need; or somebody is writing there.
    """
    jobs = list(_jobs(plan))
    with _alone(out):
        return _evaluated(jobs, out, workers, progress)


def _evaluated(jobs: Sequence[_Job], out: Path, workers: int, progress: StageReport | None) -> list[Record]:
    kept = {record.key: record for record in read_records(out / RESULTS)}
    done = {key: record for key, record in kept.items() if not _failed(record)}
    write_records(out / RESULTS, done.values())
    missing = [job for job in jobs if job.key not in done]
    with (out / RESULTS).open("a") as results:
        for record in _each(missing, workers):
            done[record.key] = record
            results.write(line(record))
            results.flush()
            if progress is not None:
                count = len(jobs) - len(missing) + sum(job.key in done for job in missing)
                progress(f"{count} of {len(jobs)} fits", count / len(jobs))
    return [done[job.key] for job in jobs]


@contextmanager
def _alone(out: Path) -> Iterator[None]:
    """Nobody else adds to the results meanwhile: who replaces the file loses what others still write."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        lock = (out / LOCK).open("a")
    except OSError as error:
        raise InputError(f"cannot write {out}: {(error.strerror or str(error)).lower()}") from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"{out}: another evaluation is writing there: give another --out") from None
        yield


def _failed(record: Record) -> bool:
    return record.failed is not None or any(each.failed is not None for each in record.unseen)


def _jobs(plan: Plan) -> Iterator[_Job]:
    """By object, then by clip, then by method."""
    read_index(plan.data)
    groups: dict[str, list[IndexEntry]] = {}
    for entry in describe(plan.data).cases:
        groups.setdefault(entry.object_name, []).append(entry)
    if not groups:
        raise InputError(f"{plan.data}: no cases in its index: generate some with `matphys scenes`")
    source = hashlib.sha256((plan.data / INDEX).read_bytes()).hexdigest()
    weights = None if plan.lpips is None else _weights(plan.lpips)
    transfers = "unseen_interaction" in plan.settings
    if transfers and all(len(entries) < 2 for entries in groups.values()):
        raise InputError(
            f"{plan.data}: one interaction per object: unseen interactions need two, leave that setting out"
        )
    for name in _chosen(groups, plan.limit):
        entries = groups[name]
        order = np.random.default_rng([plan.seed, _number(name)]).permutation(len(entries))
        for k in sorted(order[: plan.fits]):
            others = [entry for j, entry in enumerate(entries) if j != k] if transfers else []
            for method_name, method in plan.methods.items():
                yield _Job(
                    key=_key(plan, source, weights, method_name, entries[k], others),
                    name=method_name,
                    method=method,
                    case=plan.data / entries[k].file,
                    others=tuple(plan.data / entry.file for entry in others),
                    source=source,
                    plan=plan,
                )


def _chosen(groups: dict[str, list[IndexEntry]], limit: int | None) -> list[str]:
    """Names of objects: one of each class after the other, so that a limit leaves every class in."""
    queues: dict[str, list[str]] = {}
    for name in sorted(groups):
        queues.setdefault(groups[name][0].object_class, []).append(name)
    rounds = max(len(queue) for queue in queues.values())
    mixed = [queue[k] for k in range(rounds) for _, queue in sorted(queues.items()) if k < len(queue)]
    return mixed[:limit]


def _key(
    plan: Plan,
    source: str,
    weights: str | None,
    name: str,
    entry: IndexEntry,
    others: Sequence[IndexEntry],
) -> str:
    told = "given" if plan.opinion is None else f"{plan.opinion} {plan.seed}"
    pictures = f"{plan.pictures} {weights}"
    who = [name, plan.methods[name].identity()]
    content = [VERSION, *who, source, told, pictures, entry.sha256, *(other.sha256 for other in others)]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:24]


def _weights(folder: Path) -> str:
    """Of LPIPS, by what they are: the same elsewhere are the same."""
    files = sorted(folder.glob("*.pth"))
    return hashlib.sha256(b"".join(hashlib.sha256(file.read_bytes()).digest() for file in files)).hexdigest()


def _number(name: str) -> int:
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big")


def _each(jobs: Sequence[_Job], workers: int) -> Iterator[Record]:
    groups: dict[tuple[Path, str], list[_Job]] = {}
    for job in jobs:
        groups.setdefault((job.case, fitter(job.method)), []).append(job)
    if workers == 1:
        for group in groups.values():
            yield from _measured(group)
        return
    with crew(workers) as pool:
        waiting = [pool.submit(_all_measured, group) for group in groups.values()]
        try:
            for future in as_completed(waiting):
                yield from future.result()
        finally:
            pool.shutdown(cancel_futures=True)


def _all_measured(jobs: Sequence[_Job]) -> list[Record]:
    return list(_measured(jobs))


def _measured(jobs: Sequence[_Job]) -> Iterator[Record]:
    """Methods that share a fit of one clip."""
    fits = Fits()
    for job in jobs:
        yield _measure(job, fits)


def _measure(job: _Job, fits: Fits) -> Record:
    own = load_case(job.case)
    task = Task(
        key=job.key,
        name=job.name,
        method=job.method,
        case=_told(own, job.plan),
        own=own,
        others=[load_case(path) for path in job.others],
        opinion="given" if job.plan.opinion is None else job.plan.opinion,
        source=job.source,
    )
    pictures = None
    if job.plan.pictures:
        pictures = Pictures(None if job.plan.lpips is None else Lpips(job.plan.lpips))
    return judge(task, pictures, fits)


def _told(case: Case, plan: Plan) -> Case:
    """The case with the priors that methods are told; the same for every method."""
    if plan.opinion is None:
        return case
    return with_priors(case, plan.opinion, np.random.default_rng([plan.seed, _number(case.name)]))
