"""Make the jury that names effects: gather evidence of worlds whose effects are known, then train on it.

    python -m benchmarks.gap.jury own --count 200 --out out/evidence/own
    python -m benchmarks.gap.jury folder out/worlds/dev --out out/evidence/dev
    python -m benchmarks.gap.jury train out/evidence/own out/evidence/dev --out model/gap/verdict.safetensors

Own worlds are moved by the twin's simulator on other lattices; a folder is of development worlds
(`benchmarks/reality/generate.py --split dev`), never of test worlds: sealed labels are refused. `train` says
how well juries do on worlds they have not seen, also where a whole source, shape or effect is left out.
"""

import argparse
import sys
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Int64
from safetensors.torch import save_file

from benchmarks.gap.development import done_by, open_labels_of
from model.gap.benchmark.predict import taken_of
from model.gap.classifier import UNKNOWN
from model.gap.evidence import gather
from model.gap.learn import (
    Example,
    calibrated,
    cross_validated,
    folds,
    lesson_of,
    read_example,
    scores,
    train,
    with_caution,
    write_example,
)
from model.gap.meeting import able_effects
from model.gap.schema import EFFECT_NAMES
from model.gap.study import study
from model.gap.transfer import transferred
from model.gap.worlds import make_world, random_effects
from model.types import Array, Observation

BOTH = ".both.npz"
"""Ending of the evidence of two interactions together."""
TRIES = 6
"""Draws for a world whose effects cannot act in the first."""


def examples_of(
    observation: Observation, transfer: Observation | None, effects: Sequence[str], group: str
) -> list[Example]:
    """The evidence of one world, without its other interaction and, where there is one, with it."""
    torch.set_num_threads(1)
    fitted = study(observation)
    ground = observation.ground_height is not None
    named = tuple(name if name in EFFECT_NAMES else UNKNOWN for name in effects)
    shape = fitted.plain.twin.body.shape
    alone = Example(gather(fitted, able_effects(fitted)), shape, fitted.base.cost, ground, named, group)
    if transfer is None:
        return [alone]
    other = transferred(fitted, transfer).study(fitted)
    return [alone, replace(alone, evidence=alone.evidence.joined(gather(other, able_effects(other))))]


def write_examples(path: Path, examples: Sequence[Example]) -> None:
    """The first as `path`, one with another interaction beside it."""
    for example, name in zip(examples, (path, path.with_suffix(BOTH)), strict=False):
        write_example(name, example)


def own(seed: int, out: Path) -> str:
    """One world of our own."""
    path = out / f"{seed:05d}.npz"
    if path.is_file():
        return path.name
    warnings.simplefilter("ignore")
    kinds = random_effects(np.random.default_rng(seed))
    for attempt in range(TRIES):
        made = make_world(TRIES * seed + attempt, kinds)
        if made is not None:
            write_examples(path, examples_of(made.observation, None, made.effects, "own"))
            return path.name
    return f"{path.name}: {', '.join(kind.name for kind in kinds)} could not act"


def of_folder(world: str, folder: Path, effects: tuple[str, ...], out: Path) -> str:
    """One world of a folder."""
    path = out / f"{world}.npz"
    if not path.is_file():
        warnings.simplefilter("ignore")
        taken, transfer = taken_of(folder / path.name)
        write_examples(path, examples_of(taken.observation, transfer, effects, folder.name))
    return path.name


def _left_out(examples: Sequence[Example]) -> Iterator[tuple[str, list[int]]]:
    """What generalisation is asked of: every source, every shape, every effect as if it were new."""
    for group in sorted({example.group for example in examples}):
        yield f"source {group}", [i for i, e in enumerate(examples) if e.group == group]
    for shape in sorted({example.shape for example in examples}):
        yield f"shape {shape}", [i for i, e in enumerate(examples) if e.shape == shape]
    for name in EFFECT_NAMES:
        yield f"effect {name}", [i for i, e in enumerate(examples) if name in e.effects]


def _print(title: str, found: dict[str, float]) -> None:
    print(f"| {title} | " + " | ".join(f"{value:.2f}" for value in found.values()) + " |", flush=True)


def _parts(paths: Sequence[Path]) -> list[Int64[Array, " _"]]:
    """A fifth of the worlds each: what is known of one world is never in two."""
    worlds = [str(path).removesuffix(BOTH).removesuffix(".npz") for path in paths]
    unique = sorted(set(worlds))
    return [np.flatnonzero(np.isin(worlds, [unique[i] for i in part])) for part in folds(len(unique))]


def learn(folders: Sequence[Path], out: Path, leave_out: bool) -> None:
    """Train, say how well it does on worlds it has not seen, write the weights."""
    paths = [path for folder in folders for path in sorted(folder.glob("*.npz"))]
    examples = [read_example(path) for path in paths]
    lessons = [lesson_of(example, i) for i, example in enumerate(examples)]
    parts, targets = _parts(paths), np.stack([lesson.copies[0][1] for lesson in lessons])
    bold = cross_validated(lessons, parts)
    held = with_caution(bold, targets, parts)
    named = scores(examples, held)
    print("| left out | " + " | ".join(named) + " |")
    print("|---" * (len(named) + 1) + "|")
    _print("a fifth at a time", named)
    _print("the same, without caution", scores(examples, bold))
    for group in sorted({example.group for example in examples}):
        for both, word in ((False, "one interaction"), (True, "two")):
            some = [
                i
                for i, (path, example) in enumerate(zip(paths, examples, strict=True))
                if example.group == group and path.name.endswith(BOTH) == both
            ]
            if some:
                _print(f"the same, {group}, {word}", scores([examples[i] for i in some], held[some]))
    for title, part in _left_out(examples) if leave_out else ():
        if 0 < len(part) < len(examples):
            other = cross_validated(lessons, [np.array(part)])[part]
            _print(title, scores([examples[i] for i in part], other))
    jury = calibrated(train(lessons), bold, targets)
    save_file(jury.tensors(), out)
    print(f"temperature {float(jury.jurors[0].temperature):.2f}, wrote {out}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Gather or train."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    made = commands.add_parser("own", help="worlds of our own simulator")
    made.add_argument("--count", type=int, required=True)
    made.add_argument("--first", type=int, default=0, help="seed of the first")
    given = commands.add_parser("folder", help="development worlds of another generator")
    given.add_argument("worlds", type=Path)
    for gathering in (made, given):
        gathering.add_argument("--out", type=Path, required=True)
        gathering.add_argument("--workers", type=int, default=2)
    learning = commands.add_parser("train", help="the jury")
    learning.add_argument("folders", type=Path, nargs="+")
    learning.add_argument("--out", type=Path, required=True)
    learning.add_argument("--leave-out", action="store_true", help="whole sources, shapes and effects too")
    options = parser.parse_args(arguments)
    if options.command == "train":
        empty = [str(folder) for folder in options.folders if not any(folder.glob("*.npz"))]
        if empty:
            parser.error(f"no examples in {', '.join(empty)}: gather some with `own` or `folder`")
        learn(options.folders, options.out, options.leave_out)
        return 0
    options.out.mkdir(parents=True, exist_ok=True)
    if options.command == "own":
        seeds = range(options.first, options.first + options.count)
        done_by(options.workers, [partial(own, seed, options.out) for seed in seeds])
        return 0
    labels = open_labels_of(options.worlds, parser, "a jury is trained on")
    jobs = [
        partial(
            of_folder,
            label["world"],
            options.worlds,
            tuple(effect["name"] for effect in label["effects"]),
            options.out,
        )
        for label in labels
    ]
    done_by(options.workers, jobs)
    return 0


if __name__ == "__main__":
    sys.exit(main())
