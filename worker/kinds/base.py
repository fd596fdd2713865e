"""A kind of job: the seam that a further one fills with one small file.

The front imports the kinds too, so nothing here may reach torch: what a kind needs of the model it asks the
run for, and `worker.jobs` imports it when the job is at work.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import ClassVar

from pydantic import BaseModel, JsonValue

from worker.record import JobRecord

GIBIBYTE = 1 << 30


@dataclass(frozen=True)
class Input:
    """A file that a request brings."""

    inspection: str
    """The module of `worker.inspection` that looks into it first."""
    required: bool = False
    instead: str = ""
    """Another input of the kind, which may be given in its place, but not beside it."""
    beside: str = ""
    """Another input of the kind, without which this one says nothing."""
    help: str = ""
    """A sentence for who wonders what it is."""


@dataclass(frozen=True)
class Run:
    """One attempt at a job, as its kind sees it."""

    record: JobRecord
    """As it was before this attempt."""
    attempt: int
    """1 the first time."""
    parent: JobRecord | None
    """The job this one works on; None: there is none (any more)."""
    inputs: Mapping[str, Path]
    """The files of the request, by name."""
    folder: Path
    """For results and whatever else is written; gone when the attempt is over."""
    report: Callable[[str, float], None]
    """Told the stage that begins or goes on and the share of the whole, 0..1; ends a run without its job."""
    log: Callable[[str], None]
    """Adds a line to the log that the job's owner reads."""
    fetch: Callable[[JobRecord, str], Path]
    """A published file of another job, brought here."""
    send: Callable[[str, str, bytes], None]
    """POSTs to a URL, under a message id, some JSON, signed for the job's tenant; raises Undelivered."""
    model: Callable[[str], ModuleType]
    """A module of `model`, by its name there: `model("pipeline")`."""


@dataclass(frozen=True)
class Outcome:
    """What a job leaves."""

    files: tuple[Path, ...] = ()
    """To be published, under their names."""
    metrics: Mapping[str, JsonValue] | None = None


class OutOfTimeError(BaseException):
    """The job takes too long; not an Exception, so that nothing on the way up takes it for its own."""


class Postponed(Exception):
    """It cannot be done now, and nobody is to blame: try again later."""

    def __init__(self, seconds: float) -> None:
        """After so many seconds."""
        super().__init__(f"again in {seconds:.0f} s")
        self.seconds = seconds


class Kind(ABC):
    """How jobs of one kind are asked for and done."""

    name: ClassVar[str]
    queue: ClassVar[str]
    """One of `worker.queues.ALL_QUEUES`."""
    options: ClassVar[type[BaseModel]]
    """What a request may choose."""
    inputs: ClassVar[Mapping[str, Input]] = {}
    """The files a request may bring, by name."""
    about: ClassVar[Mapping[str, str]] = {}
    """Options that say something of one of these files alone, and of which one."""
    limit_s: ClassVar[float]
    """How long an attempt may take [s]."""
    memory_bytes: ClassVar[int] = 4 * GIBIBYTE
    """How much address space an attempt may take beyond what the worker has."""

    @abstractmethod
    def run(self, run: Run) -> Outcome:
        """Do it.

        Raises:
            InputError: what the user gave cannot be used; the job has failed, and the line is shown to them.
            Postponed: not now.
        """
