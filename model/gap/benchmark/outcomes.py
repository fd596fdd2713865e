"""What was said of each world, beside what was true of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from model.errors import InputError
from model.gap.benchmark.amplitudes import TRUE_VALUES
from model.gap.benchmark.labels import Label
from model.gap.benchmark.predict import Prediction
from model.gap.benchmark.scores import acting, area_under, overlap
from model.gap.schema import Closure, GapReport
from model.types import Array

REFUSED = "refused"
CLEAR = 2.0
"""Signal-to-noise ratio from which the bars count."""


@dataclass(frozen=True)
class Outcome:
    """One world."""

    world: str
    category: str
    kind: str
    names: tuple[str, ...]
    """Effects that were put in."""
    accepted: tuple[str, ...]
    """Answers that count as right."""
    magnitude: float | None
    """Of the gap after a refit, over what hides it; None: no effect was put in."""
    answers: tuple[str, ...]
    """The verdict, then all others, the most probable first; `refused` alone where there is no report."""
    both: bool
    """Of two effects, both were named."""
    confidence: float
    """Of the verdict."""
    area: float
    """Under the curve of where it acts; NaN where nothing was put in, or it acts on all points alike."""
    overlap: float
    """Of where it acts with where it was said to; NaN likewise."""
    transfer: Closure | None
    """How far the gap closes on the other interaction."""
    covered: Mapping[str, bool]
    """For quantities of the named effect whose truth is known: whether their interval holds it."""

    @property
    def answer(self) -> str:
        """The verdict."""
        return self.answers[0]

    @property
    def right(self) -> bool:
        """Whether the verdict is one of those accepted."""
        return self.answer in self.accepted

    @property
    def truth(self) -> str:
        """The one answer that stands for the truth; of two effects the one that was named, if any."""
        return self.answer if self.right else self.accepted[0]

    @property
    def clear(self) -> bool:
        """Its effect can be seen, or it has none."""
        return not self.names or (self.magnitude is not None and self.magnitude >= CLEAR)


def outcomes(predictions: Mapping[str, Prediction], labels: Sequence[Label]) -> tuple[Outcome, ...]:
    """Join predictions and labels.

    Raises:
        InputError: a world without a label, or a label without a world.
    """
    known = {label["world"]: label for label in labels}
    if odd := sorted(set(known) ^ set(predictions)):
        what = "label but no world" if odd[0] in known else "world but no label"
        raise InputError(f"{odd[0]}: there is a {what}: labels and worlds must be of the same run")
    return tuple(_outcome(name, each, known[name]) for name, each in sorted(predictions.items()))


def answers_of(report: GapReport) -> tuple[str, ...]:
    """The verdict, its second effect, then all other answers, the most probable first.

    What is left beside effects and verdict belongs to `none` and `unknown`, or to one of them.
    """
    verdict = report.verdict
    chances: dict[str, float] = {effect.name: effect.probability for effect in report.effects}
    rest = max(report.remainder, 0.0)
    others = [name for name in ("none", "unknown") if name != verdict.effect]
    chances |= {name: rest / len(others) for name in others}
    first = [name for name in (verdict.effect, verdict.second) if name is not None]
    later = sorted((name for name in chances if name not in first), key=lambda name: -chances[name])
    return (*first, *later)


def _outcome(world: str, prediction: Prediction, label: Label) -> Outcome:
    report = prediction.report
    names = tuple(str(effect["name"]) for effect in label["effects"])
    answers = (REFUSED,) if report is None else answers_of(report)
    said = set() if report is None else {report.verdict.effect, report.verdict.second}
    named = report is not None and report.verdict.effect in names
    return Outcome(
        world=world,
        category=str(label.get("category", "single" if names else "null")),
        kind=str(label.get("kind", "")),
        names=names,
        accepted=tuple(label["accepted"]),
        magnitude=label.get("magnitude") if names else None,
        answers=answers,
        both=len(names) > 1 and set(names) <= said,
        confidence=0.0 if report is None else report.verdict.probability,
        **_where(report, label, names),
        transfer=report.gap.transfer if report is not None and named else None,
        covered=_covered(report, label["effects"]) if report is not None else {},
    )


def _where(report: GapReport | None, label: Label, names: Sequence[str]) -> dict[str, float]:
    """How well the place was found: of the effect that was named, or else of the first."""
    nothing = {"area": float("nan"), "overlap": float("nan")}
    if not names or not label.get("acts_on"):
        return nothing
    named = [name for name in names if report is not None and name == report.verdict.effect]
    true: Float[Array, " N"] = np.asarray(label["acts_on"][(named or names)[0]], float)
    positive = acting(true)
    if positive.all() or not positive.any():
        return nothing
    if report is None:  # who refuses says nothing about any point
        return {"area": 0.5, "overlap": 0.0}
    said: Float[Array, " N"] = np.asarray(report.where.acts_on, float)
    if len(said) != len(true):
        raise InputError(f"{label['world']}: expected {len(said)} values in acts_on, found {len(true)}")
    return {"area": area_under(said, positive), "overlap": overlap(acting(said), positive)}


def _covered(report: GapReport, effects: Sequence[Mapping[str, Any]]) -> dict[str, bool]:
    named = next((effect for effect in effects if effect["name"] == report.verdict.effect), None)
    if named is None or named["name"] not in TRUE_VALUES:
        return {}
    fitted = report.finding(named["name"]).parameters
    covered = {}
    for name, value in TRUE_VALUES[named["name"]](named).items():
        interval = fitted[name].ci95 if name in fitted else None
        if interval is not None:
            covered[f"{named['name']}.{name}"] = interval[0] <= value <= interval[1]
    return covered
