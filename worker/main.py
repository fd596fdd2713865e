"""`matphys-worker`: makes twins, until it is told to stop."""

import contextlib
import fcntl
import importlib
import logging
import os
import shutil
import sys
import tempfile
import uuid
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import click

from model.errors import InputError
from worker.guard import Guard
from worker.janitor import Janitor
from worker.jobs import Place
from worker.kinds import ALL_KINDS, Kind
from worker.logs import log_as_json
from worker.queues import ALL_QUEUES, connect
from worker.records import Records
from worker.shepherd import CRASH, Shepherd
from worker.stable import Stable, work
from worker.storage import Storage

DONE, OUR_FAULT, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
GRACE_S = 25.0
WARM = ("pipeline", "summary", "exports")
"""What the worker imports once, for all the processes it forks."""

LOG = logging.getLogger("matphys.worker")


@dataclass(frozen=True)
class Settings:
    """How a worker works."""

    place: Place
    scratch: Path
    """Each worker has a folder of its own below it."""
    queues: tuple[str, ...] = ALL_QUEUES
    grace_s: float = GRACE_S
    """How long a job may go on after SIGTERM before it is handed back [s]."""
    mercy_s: float = 15.0
    """How long a job may go on after its time limit when it is deep in native code [s]."""


def serve(settings: Settings, kinds: Iterable[Kind] = ALL_KINDS, warm: Sequence[str] = WARM) -> None:
    """Work until SIGTERM or SIGINT: the job at work is finished within the grace, or handed back.

    Args:
        settings: How to work.
        kinds: What this worker can do.
        warm: Modules of `model` to import before the first job.

    Raises:
        InputError: the scratch folder cannot be used.
    """
    Storage(settings.place.store_url)  # refuses a wrong one; its threads begin with its first use
    name = f"{os.uname().nodename.partition('.')[0]}-{os.getpid()}-{uuid.uuid4().hex[:6]}"
    log_as_json(name)
    guard = Guard()
    janitor = Janitor(name, settings.place, guard)
    with (
        contextlib.closing(guard),
        contextlib.closing(janitor),
        _scratch(settings.scratch, name) as (scratch, lost),
    ):
        redis = connect(settings.place.redis_url)
        records = Records(redis)
        for job_id, attempt in lost:
            LOG.warning("left by a worker that died", extra={"job": job_id, "attempt": attempt})
            records.crash(job_id, attempt, CRASH)
        for module in warm:
            importlib.import_module(f"model.{module}")
        shepherd = Shepherd(
            name,
            records,
            kinds,
            guard,
            scratch,
            settings.place,
            settings.grace_s,
            settings.mercy_s,
        )
        LOG.info("ready")
        work(lambda n: Stable(f"{name}-{n}", settings.queues, redis, shepherd, janitor.revive))
        LOG.info("stopped")


@contextmanager
def _scratch(root: Path, name: str) -> Iterator[tuple[Path, Sequence[tuple[str, int]]]]:
    """A folder of this worker alone; those of workers that died are removed.

    Gives the folder, and the attempts that those workers had under way: job id and number.
    """
    folder = root / name
    lost: list[tuple[str, int]] = []
    try:
        root.mkdir(mode=0o700, parents=True, exist_ok=True)
        if root.is_symlink() or root.stat().st_uid != os.getuid():
            raise InputError(f"{root}: it belongs to somebody else: give another --scratch")
        with (root / "lock").open("w") as gate:
            fcntl.flock(gate, fcntl.LOCK_EX)
            for other in root.iterdir():
                if _abandoned(other):
                    lost += _attempts(other)
                    shutil.rmtree(other, ignore_errors=True)
            folder.mkdir(mode=0o700)
            lock = (folder / "lock").open("w")
            fcntl.flock(lock, fcntl.LOCK_EX)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror})") from None
    tempfile.tempdir = str(folder)
    try:
        yield folder, lost
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        lock.close()


def _attempts(folder: Path) -> Iterator[tuple[str, int]]:
    """The attempts that have folders in one of a worker's; `worker.shepherd` names them."""
    for entry in folder.iterdir():
        job_id, _, attempt = entry.name.rpartition("-")
        if job_id and attempt.isdecimal():
            yield job_id, int(attempt)


def _abandoned(folder: Path) -> bool:
    """Whether the worker of this folder is gone, and its horse too: both hold the lock."""
    try:
        with (folder / "lock").open("r+") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
    except OSError:
        return False


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--redis-url", envvar="REDIS_URL", required=True, metavar="URL", help="redis://… [$REDIS_URL]")
@click.option(
    "--store-url",
    envvar="STORE_URL",
    required=True,
    metavar="URL",
    help="file:///… or s3://… [$STORE_URL]",
)
@click.option(
    "--queues", default=",".join(ALL_QUEUES), show_default=True, help="Where to look for work, in this order."
)
@click.option(
    "--scratch",
    type=click.Path(path_type=Path),
    envvar="MATPHYS_SCRATCH",
    default=Path(tempfile.gettempdir()) / f"matphys-{os.getuid()}",
    show_default=True,
    help="Folder for work in progress [$MATPHYS_SCRATCH].",
)
@click.option(
    "--grace",
    type=click.FloatRange(min=0),
    envvar="MATPHYS_GRACE",
    default=GRACE_S,
    show_default=True,
    metavar="SECONDS",
    help="How long a job may go on after SIGTERM before it is handed back.",
)
@click.option(
    "--webhooks-to-private",
    is_flag=True,
    envvar="MATPHYS_WEBHOOKS_TO_PRIVATE",
    help="Send webhooks to private addresses too.",
)
def _command(
    redis_url: str, store_url: str, queues: str, scratch: Path, grace: float, webhooks_to_private: bool
) -> None:
    """Take jobs from Redis and do them, one at a time; start as many workers as the machine has room for."""
    names = tuple(name.strip() for name in queues.split(","))
    if unknown := set(names) - set(ALL_QUEUES):
        raise InputError(f"--queues {','.join(sorted(unknown))}: choose from {', '.join(ALL_QUEUES)}")
    # the pipeline's operations are small: more workers, not threads; numpy, which reads this, comes later
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    place = Place(redis_url, store_url, webhooks_to_private)
    serve(Settings(place, scratch.absolute(), names, grace))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the worker; its exit code: 0 stopped as told, 1 our fault, 2 bad input, 130 interrupted."""
    try:
        _command.main(arguments, prog_name="matphys-worker", standalone_mode=False)
        return DONE
    except (click.Abort, KeyboardInterrupt):  # before it answers to signals by itself
        return INTERRUPTED
    except click.ClickException as error:
        click.echo(f"matphys-worker: {error.format_message()}", err=True)
        return BAD_INPUT
    except InputError as error:
        click.echo(f"matphys-worker: {error}", err=True)
        return BAD_INPUT


if __name__ == "__main__":
    sys.exit(main())
