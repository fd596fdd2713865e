"""Progress of long work on stderr: a bar on a terminal, lines otherwise."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click

SILENCE = 20.0
"""Longest time [s] without a line, while work is reported."""

StageReport = Callable[[str, float], None]
"""Called with the stage at work and the share of the whole that is done, 0..1."""


@contextmanager
def progress(quiet: bool) -> Iterator[StageReport]:
    """Give the function that stages report to, for as long as the work lasts."""
    if quiet:
        yield lambda stage, share: None
    elif sys.stderr.isatty():
        with _bar() as report:
            yield report
    else:
        yield _Lines()


class _Lines:
    """One line at the start of each stage and now and then in a long one, with the time since all began."""

    def __init__(self) -> None:
        self._started = time.perf_counter()
        self._stage, self._said = "", 0.0

    def __call__(self, stage: str, share: float) -> None:
        elapsed = time.perf_counter() - self._started
        if stage != self._stage or elapsed - self._said >= SILENCE:
            click.echo(f"{elapsed:6.1f} s  {share:4.0%}  {stage}", err=True)
            self._stage, self._said = stage, elapsed


@contextmanager
def _bar() -> Iterator[StageReport]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:<16}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda stage, share: bar.update(task, description=stage, completed=share)
