"""Train the jury that names effects, on the evidence of worlds whose effects are known.

`python -m benchmarks.gap.jury` gathers such evidence and calls this.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float64, Int64

from model.formats.files import replacing
from model.gap.classifier import CLASSES, NONE, UNKNOWN, Juror, Jury, table
from model.gap.evidence import Column, Evidence
from model.gap.signs import Signs, signs_of
from model.types import Array

JURORS = 5
EPOCHS = 250
DECAY = 0.3
HIDDEN = 0.25
"""Share of worlds in which the effect at work is left out of the catalogue: unknown is then right."""
ALARMS = 0.05
"""Share of healthy twins that may be accused."""
AHEAD = 1e-4
"""By how much more none has to gain, so as not to come out even."""
COPIES = 5
"""Of each world, with other effects left out."""


@dataclass(frozen=True)
class Example:
    """A world whose effects are known."""

    evidence: Evidence
    shape: str
    cost: float
    ground: bool
    effects: tuple[str, ...]
    """At work; `unknown` where one is that the catalogue does not have."""
    group: str = ""
    """Worlds that are held out together."""

    def signs(self, leaving_out: Sequence[str] = ()) -> Signs:
        """With some effects left out of the catalogue."""
        return signs_of(self.evidence, self.shape, self.cost, self.ground, leaving_out)


def write_example(path: Path, example: Example) -> None:
    """As `read_example` reads it; the file is there whole or not at all."""
    columns = [(column.kind, column.values) for column in example.evidence.columns]
    about = {
        "shape": example.shape,
        "cost": example.cost,
        "ground": example.ground,
        "effects": example.effects,
        "group": example.group,
    }
    with replacing(path) as part, part.open("wb") as file:
        np.savez_compressed(
            file,
            grams=example.evidence.grams,
            counts=example.evidence.counts,
            columns=json.dumps(columns),
            about=json.dumps(about),
        )


def read_example(path: Path) -> Example:
    """One that was gathered."""
    with np.load(path) as file:
        columns = tuple(Column(kind, values) for kind, values in json.loads(str(file["columns"])))
        evidence = Evidence(columns, file["grams"], file["counts"])
        about = json.loads(str(file["about"]))
    effects = tuple(about["effects"])
    return Example(evidence, about["shape"], about["cost"], about["ground"], effects, about["group"])


def target(effects: Sequence[str], signs: Signs) -> Float64[Array, " k"]:
    """What is right to say: none, one of the effects, or unknown where none of them could be named."""
    right = np.zeros(len(CLASSES))
    named = [name for name in effects if name in signs.names]
    if not effects:
        right[CLASSES.index(NONE)] = 1.0
    elif not named:
        right[CLASSES.index(UNKNOWN)] = 1.0
    for name in named:
        right[CLASSES.index(name)] = 1.0 / len(named)
    return right


@dataclass(frozen=True)
class Lesson:
    """A world as it is and as it would look to smaller catalogues, each with what is right to say."""

    plain: Signs
    copies: tuple[tuple[Signs, Float64[Array, " k"]], ...]


def lesson_of(example: Example, seed: int) -> Lesson:
    """With effects left out: in some copies those at work, so that unknown is right, and some others."""
    rng = np.random.default_rng(seed)
    whole = example.signs()
    copies = [(whole, target(example.effects, whole))]
    for _ in range(COPIES - 1):
        hidden: list[str] = []
        if rng.random() < HIDDEN * COPIES / (COPIES - 1):
            hidden += example.effects
        others = [kind for kind in whole.names if kind not in example.effects]
        most = max(len(others) - 1, 0)
        hidden += list(rng.choice(others, size=min(most, int(rng.integers(0, 5))), replace=False))
        signs = example.signs(hidden)
        copies.append((signs, target(example.effects, signs)))
    return Lesson(whole, tuple(copies))


def train(lessons: Sequence[Lesson], seed: int = 0, jurors: int = JURORS) -> Jury:
    """Jurors that have seen these worlds, each with other starts and a draw of the worlds of its own."""
    members = []
    for member in range(jurors):
        rng = np.random.default_rng([seed, member])
        torch.manual_seed(int(rng.integers(1 << 30)))
        drawn = [lessons[i] for i in rng.integers(len(lessons), size=len(lessons))]
        pairs = [pair for lesson in drawn for pair in lesson.copies]
        members.append(_trained(Juror(), [s for s, _ in pairs], np.stack([t for _, t in pairs])))
    return Jury(tuple(members))


def _trained(juror: Juror, signs: list[Signs], targets: Array) -> Juror:
    each, able, context = table(signs)
    wanted = torch.from_numpy(targets).float()
    present = each[able]
    juror.sign_mean.copy_(present.mean(0))
    juror.sign_size.copy_(present.std(0) + 1e-3)
    juror.context_mean.copy_(context.mean(0))
    juror.context_size.copy_(context.std(0) + 1e-3)
    optimiser = torch.optim.AdamW(juror.parameters(), lr=0.03, weight_decay=DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, EPOCHS)
    for _ in range(EPOCHS):
        optimiser.zero_grad()
        loss = -(wanted * juror(each, able, context)).sum(1).mean() + 0.02 * juror.bias.square().sum()
        loss.backward()
        optimiser.step()
        schedule.step()
    return juror.eval()


def folds(count: int, parts: int = 5) -> list[Int64[Array, " _"]]:
    """Of equal size, the same for the same count."""
    order = np.random.default_rng(0).permutation(count)
    return [order[i::parts] for i in range(parts)]


def cross_validated(lessons: Sequence[Lesson], parts: Sequence[Int64[Array, " _"]]) -> Float64[Array, "b k"]:
    """Probabilities of each world by a jury that has not seen it, nor any of its part."""
    found = np.zeros((len(lessons), len(CLASSES)))
    for part in parts:
        held = set(part.tolist())
        jury = train([lesson for i, lesson in enumerate(lessons) if i not in held])
        found[part] = jury.probabilities([lessons[i].plain for i in part])
    return found


def calibrated(jury: Jury, probabilities: Float64[Array, "b k"], targets: Float64[Array, "b k"]) -> Jury:
    """With the temperature at which held-out probabilities score best, and with caution.

    Caution is what the logarithm of none has to gain for at most `ALARMS` of the held-out worlds without any
    effect to be accused: a healthy twin that is called ill is worse than an ill one that is called healthy.
    """
    logs = np.log(np.maximum(probabilities, 1e-12))
    temperature = min(
        np.geomspace(0.5, 3.0, 60), key=lambda t: -(targets * _softened(logs, float(t))).sum(1).mean()
    )
    caution = cautioned(_softened(logs, float(temperature)), targets)
    for juror in jury.jurors:
        juror.temperature.fill_(float(temperature))
        juror.caution.fill_(caution)
    return jury


def cautioned(logs: Float64[Array, "b k"], targets: Float64[Array, "b k"]) -> float:
    """By how much none has to gain for few enough false alarms; zero where there are none."""
    none = CLASSES.index(NONE)
    healthy = logs[targets[:, none] > 0.5]
    if not len(healthy):
        return 0.0
    lead = np.delete(healthy, none, axis=1).max(1) - healthy[:, none]
    enough = float(np.quantile(lead, 1.0 - ALARMS, method="higher"))
    return enough + AHEAD if enough >= 0.0 else 0.0


def _softened(logs: Array, temperature: float) -> Array:
    scaled = logs / temperature
    return np.asarray(scaled - np.log(np.exp(scaled).sum(1, keepdims=True)))


def with_caution(
    probabilities: Float64[Array, "b k"], targets: Float64[Array, "b k"], parts: Sequence[Int64[Array, " _"]]
) -> Float64[Array, "b k"]:
    """Held-out probabilities after caution that was learned on the other parts."""
    logs = np.log(np.maximum(probabilities, 1e-12))
    found = np.zeros_like(probabilities)
    for part in parts:
        rest = np.setdiff1d(np.arange(len(logs)), part)
        moved = logs[part].copy()
        moved[:, CLASSES.index(NONE)] += cautioned(logs[rest], targets[rest])
        found[part] = np.exp(_softened(moved, 1.0))
    return found


def scores(examples: Sequence[Example], probabilities: Float64[Array, "b k"]) -> dict[str, float]:
    """Of held-out probabilities."""
    best = np.array(CLASSES)[probabilities.argmax(1)]
    acts = np.array([bool(example.effects) for example in examples])
    first = np.array([b in (e.effects or (NONE,)) for b, e in zip(best, examples, strict=True)])
    ranked = np.array(CLASSES)[np.argsort(-probabilities[:, : len(CLASSES) - 2], axis=1)]
    third = np.array([bool(set(r[:3]) & set(e.effects)) for r, e in zip(ranked, examples, strict=True)])
    ahead = np.array([r[0] in e.effects for r, e in zip(ranked, examples, strict=True)])
    return {
        "worlds": float(len(examples)),
        "right": float(first.mean()),
        "top-1 of effects": float(first[acts].mean()),
        "first of effects": float(ahead[acts].mean()),
        "top-3 of effects": float(third[acts].mean()),
        "false alarms": float((best[~acts] != NONE).mean()) if (~acts).any() else float("nan"),
        "missed": float((best[acts] == NONE).mean()),
    }
