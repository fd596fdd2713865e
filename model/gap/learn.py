"""Train the jury that names effects, on the evidence of worlds whose effects are known.

`python -m benchmarks.gap.jury` gathers such evidence and calls this.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float64, Int64

from model.formats.files import replacing
from model.gap.classifier import CLASSES, NONE, UNKNOWN, Juror, Jury, table
from model.gap.evidence import Column, Evidence
from model.gap.signs import Signs, signs_of
from model.types import Array

JURORS = 7
EPOCHS = 400
DECAY = 0.02
HIDDEN = 0.25
"""Share of worlds in which the effect at work is left out of the catalogue: unknown is then right."""
COPIES = 4
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


def augmented(examples: Sequence[Example], rng: np.random.Generator) -> tuple[list[Signs], Array]:
    """Every world as it is, and with effects left out: those at work, so that it is unknown, and others."""
    signs, targets = [], []
    for example in examples:
        for copy in range(COPIES):
            hidden: list[str] = []
            if copy:
                hide = rng.random() < HIDDEN * COPIES / (COPIES - 1)
                hidden += example.effects if hide else ()
                others = [kind for kind in example.evidence.kinds if kind not in example.effects]
                hidden += list(rng.choice(others, size=int(rng.integers(0, 5)), replace=False))
            one = example.signs(hidden)
            signs.append(one)
            targets.append(target(example.effects, one))
    return signs, np.stack(targets)


def train(examples: Sequence[Example], seed: int = 0, jurors: int = JURORS) -> Jury:
    """Jurors that have seen these worlds, each with other starts and other effects left out."""
    members = []
    for member in range(jurors):
        rng = np.random.default_rng([seed, member])
        torch.manual_seed(int(rng.integers(1 << 30)))
        signs, targets = augmented(examples, rng)
        members.append(_trained(Juror(), signs, targets))
    return Jury(tuple(members))


def _trained(juror: Juror, signs: list[Signs], targets: Array) -> Juror:
    each, able, context = table(signs)
    wanted = torch.from_numpy(targets).float()
    present = each[able]
    juror.sign_mean.copy_(present.mean(0))
    juror.sign_size.copy_(present.std(0) + 1e-3)
    juror.context_mean.copy_(context.mean(0))
    juror.context_size.copy_(context.std(0) + 1e-3)
    optimiser = torch.optim.AdamW(juror.parameters(), lr=0.01, weight_decay=DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, EPOCHS)
    for _ in range(EPOCHS):
        optimiser.zero_grad()
        loss = -(wanted * juror(each, able, context)).sum(1).mean() + 0.01 * juror.bias.square().sum()
        loss.backward()
        optimiser.step()
        schedule.step()
    return juror.eval()


def folds(examples: Sequence[Example], count: int = 5) -> list[Int64[Array, " n"]]:
    """Of equal size, the same for the same examples."""
    order = np.random.default_rng(0).permutation(len(examples))
    return [order[i::count] for i in range(count)]


def cross_validated(
    examples: Sequence[Example],
    parts: Sequence[Int64[Array, " n"]],
    trained: Callable[[Sequence[Example]], Jury] = train,
) -> Float64[Array, "b k"]:
    """Probabilities of each world by a jury that has not seen it, nor any of its part."""
    found = np.zeros((len(examples), len(CLASSES)))
    for part in parts:
        rest = [example for i, example in enumerate(examples) if i not in set(part.tolist())]
        jury = trained(rest)
        found[part] = jury.probabilities([examples[i].signs() for i in part])
    return found


def calibrated(jury: Jury, probabilities: Float64[Array, "b k"], targets: Float64[Array, "b k"]) -> Jury:
    """With the temperature at which held-out probabilities score best."""
    logs = np.log(np.maximum(probabilities, 1e-12))
    best = min(np.geomspace(0.5, 3.0, 60), key=lambda t: -(targets * _softened(logs, float(t))).sum(1).mean())
    for juror in jury.jurors:
        juror.temperature.fill_(float(best))
    return replace(jury)


def _softened(logs: Array, temperature: float) -> Array:
    scaled = logs / temperature
    return np.asarray(scaled - np.log(np.exp(scaled).sum(1, keepdims=True)))


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
