"""Motion features of cases on disk, so that each case is described once per encoder."""

import hashlib
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from model.crew import crew
from model.encoders.motion import MotionEncoder
from model.errors import InputError
from model.formats.files import replacing
from model.formats.npz import read_arrays
from model.predictor.motion import describe_motion
from model.predictor.motion_features import MotionFeatures
from model.progress import StageReport
from model.scenes.case import Case
from model.scenes.files import load_case
from model.scenes.film import set_scene, shoot
from model.types import Array, Camera

FILM = (320, 240)
"""Width and height of the film of a case, for encoders that look at images [px]."""
STORE = "motion"
"""Folder beside the cases."""


@dataclass(frozen=True)
class _Job:
    case: Path
    kept: Path
    encoder: MotionEncoder


def describe_case(case: Case, encoder: MotionEncoder) -> MotionFeatures:
    """Describe the frames of a case that may be learned from; the others are not looked at.

    For an encoder that looks at images the case is filmed (`model.scenes.film`), in a size that suits it.

    Raises:
        InputError: the encoder needs what the case does not have.
    """
    images, camera = _filmed(case) if encoder.needs_images else (None, case.camera)
    return describe_motion(
        case.topology,
        case.shape_class,
        case.rest,
        case.anchors,
        case.observation,
        camera,
        case.split,
        encoder,
        images,
    )


def store_motion(
    paths: Sequence[Path], encoder: MotionEncoder, workers: int = 1, progress: StageReport | None = None
) -> None:
    """Describe the cases that have not been described by this encoder yet.

    What it finds is kept in `motion/ENCODER/` beside each case, under the sha256 of the case: another case of
    the same name, another encoder, another version or other weights of it do not meet what is there.

    Args:
        paths: Files of cases.
        encoder: What describes them.
        workers: Processes; 1: this one.
        progress: Told the share that is done.

    Raises:
        InputError: a case cannot be read, or the encoder needs what it does not have.
    """
    jobs = [_Job(path, _place(path, encoder), encoder) for path in paths]
    missing = [job for job in jobs if not job.kept.is_file()]
    for done, _ in enumerate(_each(missing, workers), 1):
        if progress is not None:
            progress(f"motion of {len(missing)} cases", done / len(missing))


def read_motion(path: Path, encoder: MotionEncoder) -> MotionFeatures:
    """What `store_motion` kept of the case in that file.

    Raises:
        InputError: nothing is kept, or not in these terms.
    """
    kept = _place(path, encoder)
    try:
        arrays = read_arrays(kept, ["points", "whole"])
        return MotionFeatures(
            np.array(arrays["points"], np.float32).reshape(-1, encoder.dim),
            np.array(arrays["whole"], np.float32).reshape(encoder.global_dim),
        )
    except (InputError, KeyError, ValueError):
        raise InputError(
            f"{kept}: expected the motion of {path.name}, found something else: delete it, it is made again"
        ) from None


def _filmed(case: Case) -> tuple[UInt8[Array, "T H W 3"], Camera]:
    """Frames of the case, those that may be learned from, and the camera that took them."""
    scene = set_scene(case, FILM, seed=0)
    shots = islice(shoot(scene, np.random.default_rng(0)), case.split)
    return np.stack([shot.picture for shot in shots]), scene.camera


def _place(path: Path, encoder: MotionEncoder) -> Path:
    weights = "" if encoder.weights is None else f"-{encoder.weights[:16]}"
    folder = path.parent / STORE / f"{encoder.name}-{encoder.version}{weights}"
    return folder / f"{hashlib.sha256(path.read_bytes()).hexdigest()[:32]}.npz"


def _each(jobs: Sequence[_Job], workers: int) -> Iterator[None]:
    if workers <= 1 or len(jobs) <= 1:
        yield from map(_describe, jobs)
        return
    with crew(workers) as pool:
        yield from pool.map(_describe, jobs)


def _describe(job: _Job) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what the simulator says of twins of reference is not news
        found = describe_case(load_case(job.case), job.encoder)
    with replacing(job.kept) as part, part.open("wb") as file:
        np.savez_compressed(file, points=found.points, whole=found.whole)
