"""Every world of a folder diagnosed: in several processes, resumable, written down and hashed."""

import hashlib
import json
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from model.crew import crew
from model.errors import InputError
from model.formats.files import replacing
from model.gap.account import MEANING, Account
from model.gap.classifier import WEIGHTS as JURY
from model.gap.diagnosis import Diagnosis
from model.gap.schema import GapReport
from model.gap.taken import Taken
from model.gap.weighing import WEIGHTS as WEIGHING
from model.observation import read_observation
from model.progress import StageReport
from model.schema import write_json
from model.types import Observation
from model.version import __version__

DIAGNOSES, PREDICTIONS = "diagnoses", "predictions.json"
SCHEMA = "matphys.predictions/1"
TRANSFER = ".transfer.npz"
WEIGHTS = (JURY, WEIGHING)


@runtime_checkable
class Diagnose(Protocol):
    """`model.gap.diagnose.diagnose`, or what stands in for it."""

    def __call__(
        self, observation: Observation, *, transfer: Observation | None, progress: StageReport | None
    ) -> Diagnosis:
        """Diagnose an observation without a twin."""


@dataclass(frozen=True)
class Prediction:
    """What was said of a world before its label was read."""

    report: GapReport | None
    """None: the diagnosis was refused, or broke."""
    refused: str = ""
    """Why."""
    seconds: float = 0.0
    """That it took; 0 where it is not known."""
    broke: bool = False
    """By a fault of ours, not of the observation."""


@dataclass(frozen=True)
class _Job:
    world: Path
    kept: Path
    diagnose: Diagnose


def predict(
    worlds: Path, out: Path, diagnose: Diagnose, workers: int, progress: StageReport | None = None
) -> dict[str, Prediction]:
    """Diagnose all worlds and write `predictions.json`.

    What is in `out` already, of the same files by the same version and weights, is not done again, unless
    it broke.

    Args:
        worlds: Holds NAME.npz and, for another interaction of the same object, NAME.transfer.npz.
        out: Made if missing.
        diagnose: A function of a module, so that other processes can import it.
        workers: Processes; 1: this one.
        progress: Told the share that is done.

    Returns:
        By name of the world.

    Raises:
        InputError: there are no worlds.
    """
    jobs = [_Job(path, out / DIAGNOSES / f"{path.stem}.json", diagnose) for path in worlds_of(worlds)]
    predictions = {}
    for done, (job, prediction) in enumerate(zip(jobs, _each(jobs, workers), strict=True), 1):
        predictions[job.world.stem] = prediction
        if progress is not None:
            progress(f"{done} of {len(jobs)} worlds", done / len(jobs))
    _write(out / PREDICTIONS, predictions)
    return predictions


def worlds_of(folder: Path) -> list[Path]:
    """Observations NAME.npz, by name, without those of other interactions.

    Raises:
        InputError: there are none.
    """
    found = sorted(path for path in folder.glob("*.npz") if not path.name.endswith(TRANSFER))
    if not found:
        raise InputError(f"{folder}: expected worlds NAME.npz, found none")
    return found


def transfer_of(world: Path) -> Path:
    """Where the other interaction of a world is, if there is one."""
    return world.with_name(world.stem + TRANSFER)


def taken_of(world: Path) -> tuple[Taken, Observation | None]:
    """What is diagnosed of a world, and of its other interaction, if there is one: as by the command line.

    Raises:
        InputError: one of the files cannot be diagnosed.
    """
    taken, other = Taken.of(read_observation(world), world.name), transfer_of(world)
    return taken, taken.other(read_observation(other), other.name) if other.is_file() else None


def read_predictions(path: Path) -> dict[str, Prediction]:
    """What `predict` wrote."""
    content = json.loads(path.read_bytes())
    return {
        name: Prediction(_report(each["report"]), each["refused"]) for name, each in content["worlds"].items()
    }


def read_account(out: Path, world: str) -> Account | None:
    """What the verdict on a world was made of, if `predict` wrote it, and as accounts are meant today."""
    kept = out / DIAGNOSES / f"{world}.json"
    content = json.loads(kept.read_bytes()) if kept.is_file() else {}
    return Account.of(content["account"]) if content.get("meaning") == MEANING else None


def diagnosed_by() -> str:
    """The version, and the hash of the weights of the diagnosis."""
    return f"{__version__} {digest(*(files('model.gap').joinpath(name) for name in WEIGHTS))}"


def digest(*paths: Path | Traversable) -> str:
    """SHA-256 of files, one after the other."""
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()


def _each(jobs: Sequence[_Job], workers: int) -> Iterator[Prediction]:
    if workers == 1:
        yield from map(_predict, jobs)
        return
    with crew(workers) as pool:
        yield from pool.map(_predict, jobs)


def _predict(job: _Job) -> Prediction:
    other = transfer_of(job.world)
    same = digest(job.world, *([other] if other.exists() else []))
    known = _kept(job.kept, same)
    if known is not None:
        return known
    began = time.perf_counter()
    report, account, refused, broke = None, None, "", False
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # doubts about an observation are in its report
            taken, transfer = taken_of(job.world)
            diagnosis = job.diagnose(taken.observation, transfer=transfer, progress=None)
        report, account = taken.report(diagnosis.findings.report), diagnosis.account
    except InputError as error:
        refused = str(error)
    except Exception as error:  # one world that breaks must not end the check, and counts as wrong
        refused, broke = f"{type(error).__name__}: {error}", True
    seconds = time.perf_counter() - began
    _keep(
        job.kept,
        {"sha256": same, "by": diagnosed_by(), "seconds": seconds}
        | {**_plain(report, refused), "broke": broke}
        | ({} if account is None else {"meaning": MEANING, "account": asdict(account)}),
    )
    return Prediction(report, refused, seconds, broke)


def _kept(path: Path, same: str) -> Prediction | None:
    if not path.is_file():
        return None
    kept = json.loads(path.read_bytes())
    if kept["sha256"] != same or kept.get("by") != diagnosed_by() or kept["broke"]:
        return None
    return Prediction(_report(kept["report"]), kept["refused"], kept["seconds"])


def _keep(path: Path, content: Mapping[str, Any]) -> None:
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(content))


def _write(path: Path, predictions: Mapping[str, Prediction]) -> None:
    content = {name: _plain(each.report, each.refused) for name, each in predictions.items()}
    with replacing(path) as temporary:
        temporary.write_text(json.dumps({"schema": SCHEMA, "worlds": content}))


def _plain(report: GapReport | None, refused: str) -> dict[str, Any]:
    return {"report": None if report is None else json.loads(write_json(report)), "refused": refused}


def _report(content: Mapping[str, Any] | None) -> GapReport | None:
    return None if content is None else GapReport.model_validate(content)
