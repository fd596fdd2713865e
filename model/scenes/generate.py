"""A folder of generated cases: the same for the same seed, however many processes make it."""

import shutil
import warnings
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from functools import partial
from pathlib import Path

from model.crew import crew
from model.errors import InputError
from model.one_thread import one_thread
from model.progress import StageReport
from model.scenes.case import ObjectClass
from model.scenes.files import SUFFIX, CaseIndex, check_no_cases, save_case, write_index
from model.scenes.world.shapes import CLASSES

FILMS = "films"
"""Folder of the folders of films."""
AHEAD = 4
"""Objects that wait for each process."""


def generate(
    folder: Path,
    count: int,
    seed: int = 0,
    *,
    workers: int = 1,
    classes: tuple[ObjectClass, ...] = CLASSES,
    first: int = 0,
    interactions: int | None = None,
    films: bool = False,
    report: StageReport = lambda stage, share: None,
) -> CaseIndex:
    """Make objects with their cases, and the index of the folder.

    Object number i of a seed is the same in every folder of the same classes; its name says its class.

    Args:
        folder: Where the files go: an empty or a new one.
        count: Objects; each comes in three or four interactions.
        seed: Of the world.
        workers: Processes.
        classes: Of objects, which take turns.
        first: Number of the first object.
        interactions: How many per object; None: three or four.
        films: Also film every case, into a folder of its own below `films`.
        report: Told how far the work is.

    Raises:
        InputError: the folder has cases already, or cannot be written to.
    """
    check_no_cases(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot write {folder}: {(error.strerror or str(error)).lower()}") from None
    task = partial(_make, folder, seed, classes, interactions, films)
    report("scenes", 0.0)
    try:
        for done, trouble in enumerate(_in_processes(task, range(first, first + count), workers), start=1):
            if trouble:
                warnings.warn(trouble, stacklevel=2)
            report("scenes", done / (count + 1))
        index = write_index(folder, seed)
    except BaseException:  # Ctrl-C above all: cases without an index are no folder of cases
        for path in folder.glob(f"*{SUFFIX}"):
            path.unlink(missing_ok=True)
            shutil.rmtree(folder / FILMS / path.name.removesuffix(SUFFIX), ignore_errors=True)
        raise
    report("done", 1.0)
    return index


def _make(
    folder: Path,
    seed: int,
    classes: tuple[ObjectClass, ...],
    interactions: int | None,
    films: bool,
    number: int,
) -> str:
    """One object's cases, as files. A world that diverges is left out; returns what to say of it, if so."""
    from model.scenes.room import LeftTheRoom
    from model.scenes.world.cases import draw_cases
    from model.simulator.divergence import SimulationDiverged

    try:
        with one_thread():
            cases = draw_cases(seed, number, classes[number % len(classes)], interactions)
    except (SimulationDiverged, LeftTheRoom) as error:
        return f"object {number} of seed {seed} is left out: {error}"
    for case in cases:
        save_case(case, folder / f"{case.name}{SUFFIX}")
        if films:
            from model.scenes.film import film_case

            with one_thread():
                film_case(case, folder / FILMS / case.name, seed=seed)
    return ""


def _in_processes(task: "partial[str]", numbers: range, workers: int) -> Iterator[str]:
    """Results as they come; an interruption stops what has not begun."""
    if workers == 1:
        yield from map(task, numbers)
        return
    with crew(workers) as pool:
        left, waiting = iter(numbers), set[Future[str]]()
        try:
            while True:
                for number in left:
                    waiting.add(pool.submit(task, number))
                    if len(waiting) >= AHEAD * workers:
                        break
                if not waiting:
                    return
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for future in done:
                    yield future.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
