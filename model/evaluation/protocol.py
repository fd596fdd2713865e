"""Four settings in which a method is judged, and nothing that it could cheat with.

`reconstruction`: the frames that were learned from, simulated again. `future`: the frames of the same clip
from the split (7:3) on. `unseen_interaction`: all of another clip of the object. `unseen_object`: the future
of objects on which the method was not trained; one that learns from each clip alone knows none beforehand.
"""

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias, get_args

import numpy as np
from jaxtyping import Float32, Float64

from model.evaluation.baselines.base import Fitted, Method
from model.evaluation.baselines.hold_last import HoldLast
from model.evaluation.fits import Fit, Fits, reason
from model.evaluation.hidden import answer, seen_until_split, unseen
from model.evaluation.metrics import chamfer, matched_track_error, mean_over, track_error
from model.evaluation.pictures import Pictures
from model.evaluation.records import GlobalRecord, PartRecord, Record, Scores, Transfer
from model.evaluation.truth import part_belief
from model.priors.materials import MATERIALS
from model.scenes.case import Case
from model.scenes.room import ROOM, LeftTheRoom, check_near
from model.types import Array

Setting: TypeAlias = Literal["reconstruction", "future", "unseen_interaction", "unseen_object"]
SETTINGS: tuple[Setting, ...] = get_args(Setting)
GLOBALS = ("dashpot_damping", "drag_rate", "friction", "restitution")


@dataclass(frozen=True)
class Task:
    """One method on one case."""

    key: str
    """Of everything that the result depends on."""
    name: str
    """Of the method, in tables."""
    method: Method
    case: Case
    """With the priors that the method is told, and the truth."""
    own: Case
    """The same with its own priors."""
    others: Sequence[Case] = field(default=())
    """Other interactions of the object, which are to be predicted too."""
    opinion: str = "given"
    """Whose the priors are."""
    source: str | None = None
    """sha256 of the index of the folder that the case is from."""


def judge(task: Task, pictures: Pictures | None = None, fits: Fits | None = None) -> Record:
    """Fit a method to what it may see of a case and measure what it predicts.

    A method that fails, or predicts something that is not finite, is scored as if nothing moved any more, and
    the record says why it failed.

    Args:
        task: What to do.
        pictures: Measures pictures too.
        fits: Of the same clip, by other methods; None: none yet.
    """
    case, shown = task.case, seen_until_split(task.case)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # doubts about thousands of cases help nobody
        known, ignorance = _knew(task)
        made = Fit(None, ignorance, 0.0) if ignorance else (fits or Fits()).of(task.method, shown)
        fitted, failure = made.fitted, made.failure
        began = time.perf_counter()
        predicted, failed = _predict(fitted, shown, shown, failure)
        predict_seconds = time.perf_counter() - began
        transfers = []
        for other in task.others:
            hidden = unseen(other, shown.priors)
            motion, broken = _predict(fitted, shown, hidden, failure)
            frames = range(1, len(motion))
            scores = scored(other, motion, frames, pictures)
            transfers.append(
                Transfer(case=other.name, interaction=other.interaction, scores=scores, failed=broken)
            )
    curve = _whole(track_error(answer(case), predicted))
    return Record(
        key=task.key,
        method=task.name,
        identity=task.method.identity(),
        case=case.name,
        object_name=case.object_name,
        object_class=case.object_class,
        interaction=case.interaction,
        priors=task.opinion,
        known_object=known,
        fit_seconds=made.seconds,
        predict_seconds=predict_seconds,
        failed=failed,
        reconstruction=scored(case, predicted, range(1, case.split), pictures),
        future=scored(case, predicted, range(case.split, len(predicted)), pictures),
        unseen=transfers,
        curve=[round(float(value), 7) for value in curve],
        parts=[] if fitted is None else _parts(fitted, shown, task.own),
        globals={} if fitted is None else _globals(fitted, case),
    )


def scored(
    case: Case, predicted: Float32[Array, "T N 3"], frames: Sequence[int], pictures: Pictures | None = None
) -> Scores:
    """Every metric of a prediction over some frames of a case; without those of which nothing is known."""
    truth = answer(case)
    if not len(frames):
        return {}
    chosen = np.asarray(frames)
    matched = matched_track_error(case.observation.points[0], truth, predicted)
    found = {
        "chamfer": mean_over(chamfer(truth[chosen], predicted[chosen])),
        "track": mean_over(track_error(truth[chosen], predicted[chosen])),
        "matched": mean_over(matched[chosen]),
    }
    scores = {name: value for name, value in found.items() if value is not None}
    return scores if pictures is None else scores | pictures.scores(case, predicted, frames)


def _knew(task: Task) -> tuple[bool, str | None]:
    """Whether the method was trained on the object; or why it cannot say, which is a failure as any other."""
    try:
        return task.source is not None and task.method.knew(task.source, task.case.object_name), None
    except Exception as error:  # as in `fit`
        return False, reason(error)


def _predict(
    fitted: Fitted | None, shown: Case, asked: Case, failure: str | None
) -> tuple[Float32[Array, "T N 3"], str | None]:
    """The prediction, or what stands in for it and why."""
    if fitted is not None:
        try:
            predicted = fitted.predict(asked)
            expected = asked.observation.points.shape
            if predicted.shape != expected:
                failure = f"predicted an array of shape {predicted.shape} where {expected} was asked for"
            elif not np.isfinite(predicted).all():
                failure = "predicted something that is not finite"
            else:
                check_near(predicted, asked.rest)
                return predicted, None
        except LeftTheRoom:
            failure = f"predicted something that is more than {ROOM:g} m from where it lay"
        except Exception as error:  # as in `fit`
            failure = reason(error)
    return HoldLast().fit(shown).predict(asked), failure


def _whole(curve: Float64[Array, " T"]) -> Float64[Array, " T"]:
    """With what is between frames of which something is known; empty where nothing ever is."""
    known = np.flatnonzero(np.isfinite(curve))
    return np.interp(np.arange(len(curve)), known, curve[known]) if len(known) else curve[:0]


def _parts(fitted: Fitted, shown: Case, own: Case) -> list[PartRecord]:
    belief = part_belief(fitted, shown, own.priors)
    if belief is None:
        return []
    truth = own.truth
    records = []
    for part, mean in enumerate(belief.log_modulus):
        material = own.priors[part].distribution.argmax() if truth is None else truth.material[part]
        if np.isfinite(mean):
            records.append(
                PartRecord(
                    part=part,
                    material=MATERIALS[int(material)],
                    log_truth=None if truth is None else float(np.log(truth.modulus[part])),
                    log_estimate=float(mean),
                    log_spread=None if belief.log_spread is None else float(belief.log_spread[part]),
                )
            )
    return records


def _globals(fitted: Fitted, case: Case) -> dict[str, GlobalRecord]:
    if fitted.parameters is None or case.truth is None:
        return {}
    found = {}
    for name in GLOBALS:
        parameter = fitted.parameters.globals[name]
        if not isinstance(parameter.value, tuple):
            truth = float(getattr(case.truth, name))
            found[name] = GlobalRecord(truth=truth, estimate=parameter.value, std=parameter.std)
    return found
