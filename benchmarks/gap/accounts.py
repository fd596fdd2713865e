"""Accounts of development worlds: what their diagnoses saw, beside what is right.

    python -m benchmarks.gap.accounts gather out/worlds/clear --out out/told/clear
    python -m benchmarks.gap.accounts gather out/worlds/dev --out out/told/dev
    python -m benchmarks.gap.accounts lattices out/worlds/dev --out out/told/dev
    python -m benchmarks.gap.accounts flexible out/worlds/dev --out out/told/dev
    python -m benchmarks.gap.accounts opened out/test out/test_checked --out out/told/test

`gather` diagnoses development worlds (`benchmarks/reality/generate.py --split dev`), never test worlds:
sealed labels are refused. What the folder holds is not done again, and a world whose effect is too faint to
learn from (`SEEN`) is not done at all. `lattices` asks of accounts that were gathered before this was asked
what the twin leaves of itself on other lattices, after its first fit; `flexible` what a force explains that
may be any missing physics. `opened` takes test worlds as they
come out of `matphys gap-benchmark out/test --out out/test_checked`, which diagnosed them sealed and then
opened them. `benchmarks/gap/weighing.py` learns from what they write.
"""

import argparse
import json
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

from benchmarks.gap.development import ask_kinds, done_by, open_labels_of
from model.errors import InputError
from model.gap.account import MEANING, Account, Explained
from model.gap.accounting import explained_by
from model.gap.benchmark.labels import Label, open_labels
from model.gap.benchmark.predict import PREDICTIONS, read_account, taken_of
from model.gap.ceiling import ceiling
from model.gap.classifier import NONE, UNKNOWN
from model.gap.confirm import refit
from model.gap.diagnose import diagnose
from model.gap.guessed_twin import guessed_twin
from model.gap.lattices import lattices_of, left_here, left_there
from model.gap.schema import VerdictName
from model.gap.slowly import left_slowly
from model.gap.study import Study, study
from model.gap.transfer import Followed, transferred
from model.types import Observation

SEEN = 1.5
"""Signal-to-noise from which an effect is there to be learned from."""


@dataclass(frozen=True)
class Told:
    """A development world: what its diagnosis saw, and what is right."""

    world: str
    group: str
    """Folder of the worlds that it is of."""
    generator: str
    """What moved it."""
    right: tuple[VerdictName, ...]
    """Answers that are right; of a hand that is late by itself both its delay and none."""
    magnitude: float | None
    account: Account

    @property
    def clear(self) -> bool:
        """Nothing is at work, or it can be seen."""
        return seen(self.magnitude)

    @property
    def kind(self) -> VerdictName | None:
        """Of its right answers: none, unknown, or an effect (None)."""
        if NONE in self.right:
            return NONE
        return UNKNOWN if UNKNOWN in self.right else None

    @classmethod
    def read(cls, path: Path) -> "Told":
        """What `gather` wrote."""
        content = json.loads(path.read_bytes())
        if content.pop("meaning", None) != MEANING:
            raise SystemExit(
                f"{path}: gathered when accounts meant something else; remove it and gather again"
            )
        known = {"right": tuple(content["right"]), "account": Account.of(content["account"])}
        return cls(**content | known)

    @classmethod
    def of(cls, label: Label, group: str, account: Account) -> "Told":
        """What a world was found to be, and what it is."""
        right, generator = tuple(label["accepted"]), label["generator"]
        return cls(label["world"], group, generator, right, label.get("magnitude"), account)

    def write(self, folder: Path) -> str:
        """Keep it; returns the name of the file."""
        path = folder / f"{self.world}.json"
        path.write_text(json.dumps({"meaning": MEANING} | asdict(self), indent=1))
        return path.name


def seen(magnitude: float | None) -> bool:
    """Whether a world with an effect of this signal-to-noise teaches anything; None: nothing is at work."""
    return magnitude is None or magnitude >= SEEN


def gathered(label: Label, folder: Path, out: Path) -> str:
    """One world diagnosed, its account written down; what is refused is said, and the others go on."""
    world = label["world"]
    kept = out / f"{world}.json"
    if kept.is_file():
        return kept.name
    warnings.simplefilter("ignore")
    try:
        taken, transfer = taken_of(folder / f"{world}.npz")
    except InputError as error:
        return f"refused: {error}"
    account = diagnose(taken.observation, transfer=transfer).account
    assert account is not None
    return Told.of(label, folder.name, account).write(out)


def asked(label: Label, folder: Path, out: Path, part: str) -> str:
    """A part of an account that was gathered before it was asked for; what is told already is left alone."""
    path = out / f"{label['world']}.json"
    known = Told.read(path)
    if getattr(known.account, part):
        return path.name
    warnings.simplefilter("ignore")
    taken, transfer = taken_of(folder / f"{label['world']}.npz")
    fitted = study(taken.observation, guessed_twin(taken.observation, transfer))
    account = replace(known.account, **{part: PARTS[part](fitted, transfer)})
    return replace(known, account=account).write(out)


def lattices(fitted: Study, transfer: Observation | None) -> tuple[float | None, ...]:
    """What a twin leaves of itself on other lattices, after its first fit."""
    values = fitted.base.values
    others = lattices_of(fitted)
    here = left_here(others, fitted.misfit, values)
    if transfer is None:
        return (here,)
    other = transferred(fitted, transfer)
    there = other.study(fitted)
    return here, left_there(others, fitted, other, values, Followed(there.misfit, there.base))


def flexible(fitted: Study, transfer: Observation | None) -> Explained:
    """What a force explains of the first recording that may be any missing physics."""
    plain = refit(fitted)
    slowly = left_slowly(plain.misfit, plain.estimate.values)
    return explained_by(ceiling(fitted, plain), fitted, plain, slowly)


PARTS: Mapping[str, Callable[[Study, Observation | None], object]] = {
    "lattices": lattices,
    "flexible": flexible,
}
"""Of an account, by the command that asks for it."""


def opened(folder: Path, checked: Path, out: Path) -> int:
    """Worlds of a test that was opened, as `matphys gap-benchmark` told of them in the folder `checked`.

    Returns:
        How many; others were refused or told when accounts meant something else.
    """
    labels = open_labels(folder, checked / PREDICTIONS)
    accounts = [(label, read_account(checked, label["world"])) for label in labels]
    known = [Told.of(label, folder.name, one) for label, one in accounts if one is not None]
    for one in known:
        one.write(out)
    return len(known)


def told_in(folders: Sequence[Path]) -> list[Told]:
    """All clear worlds that were gathered; then those with two recordings once more, without the other."""
    everything = [Told.read(path) for folder in folders for path in sorted(folder.glob("*.json"))]
    clear = [one for one in everything if one.clear]
    two = [one for one in clear if len(one.account.left) > 1]
    return [*clear, *(replace(one, account=one.account.alone) for one in two)]


def once(worlds: Sequence[Told]) -> list[Told]:
    """Each world once, with all its recordings."""
    by_recordings = sorted(worlds, key=lambda one: len(one.account.left))
    return list({one.world: one for one in by_recordings}.values())


def main(arguments: Sequence[str] | None = None) -> int:
    """Gather, ask for what was not gathered, or take over what was opened."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    for name, does, to in (
        ("gather", "diagnose development worlds", "where the accounts go"),
        ("lattices", "ask of accounts what other lattices leave", "where the accounts are"),
        ("flexible", "ask of accounts what a flexible force explains", "where the accounts are"),
    ):
        each = commands.add_parser(name, help=does)
        each.add_argument("worlds", type=Path)
        ask_kinds(each)
        each.add_argument("--out", type=Path, required=True, help=to)
        each.add_argument("--workers", type=int, default=2)
    opening = commands.add_parser("opened", help="test worlds that a check has opened")
    opening.add_argument("worlds", type=Path)
    opening.add_argument("checked", type=Path, help="the --out of `matphys gap-benchmark`")
    opening.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(arguments)
    options.out.mkdir(parents=True, exist_ok=True)
    if options.command == "opened":
        print(f"wrote {opened(options.worlds, options.checked, options.out)} worlds to {options.out}")
        return 0
    labels = open_labels_of(options.worlds, parser, "weights are learned from")
    labels = [label for label in labels if label["kind"] in options.kind]
    if options.command in PARTS:
        there = [label for label in labels if (options.out / f"{label['world']}.json").is_file()]
        part = options.command
        done_by(
            options.workers, [partial(asked, label, options.worlds, options.out, part) for label in there]
        )
        return 0
    told = [label for label in labels if seen(label.get("magnitude"))]
    if len(told) < len(labels):
        print(f"{len(labels) - len(told)} of {len(labels)} worlds are too faint to learn from", flush=True)
    jobs = [partial(gathered, label, options.worlds, options.out) for label in told]
    done_by(options.workers, jobs)
    return 0


if __name__ == "__main__":
    sys.exit(main())
