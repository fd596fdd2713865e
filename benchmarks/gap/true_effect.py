"""How much is seen of an effect that is known, and how far the gap shrinks elsewhere once it is added.

    python -m benchmarks.gap.true_effect out/worlds/clear out/worlds/flexclear out/worlds/dev

A diagnosis may name the wrong effect, or have fitted others; here the plain twin and the twin with the effect
that is really at work are fitted to the first recording of development worlds, as a diagnosis does it, and
both foretell the other one. Of a pair of effects it is the first. Where label and law mean the same by a
strength (`model/gap/benchmark/amplitudes.py`), its interval is held against the truth. Worlds
too faint to learn from are left out (`SEEN` of `benchmarks.gap.accounts`).
"""

import argparse
import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.gap.accounts import seen
from benchmarks.gap.development import ask_kinds, open_labels_of
from model.gap.afresh import afresh
from model.gap.benchmark.amplitudes import TRUE_VALUES
from model.gap.benchmark.labels import Label
from model.gap.benchmark.outcomes import CLEAR
from model.gap.benchmark.predict import taken_of
from model.gap.closure import closure, transfer
from model.gap.confirm import Confirmed, confirm, refit
from model.gap.elsewhere import Elsewhere
from model.gap.meeting import able_effects
from model.gap.schema import EFFECT_NAMES, Closure
from model.gap.search import searched
from model.gap.study import study
from model.gap.transfer import transferred
from model.one_thread import one_thread

HEADER = (
    "| world | object | lacks | times noise left: refitted | with it | later mm: refitted | with it | "
    "elsewhere mm: refitted | with it | closed | strength off by half widths |"
)


@dataclass(frozen=True)
class Known:
    """Of one world: what is left without its effect and with it."""

    label: Label
    left: tuple[float, float]
    """Mean squares over those of noise in the frames that were fitted."""
    here: Closure
    there: Closure
    off: Mapping[str, float]
    """From `widths_off`."""

    @property
    def row(self) -> str:
        """Of a table, errors in millimetres."""
        label, here, there = self.label, self.here, self.there
        pairs = (self.left, _millimetres(here), _millimetres(there))
        cells = [label["world"], label["kind"], label["accepted"][0]]
        cells += [f"{value:.1f}" for pair in pairs for value in pair]
        closed = there.closed_fraction
        cells.append("–" if closed is None else f"{closed:.2f}")
        cells.append(", ".join(f"{name} {off:.1f}" for name, off in self.off.items()) or "–")
        return f"| {' | '.join(cells)} |"


def _millimetres(closure: Closure) -> tuple[float, float]:
    assert closure.with_effect is not None
    return 1e3 * closure.refit, 1e3 * closure.with_effect


def known(label: Label, folder: Path) -> Known | None:
    """The effect of a world fitted to its first recording; None: it cannot act there, as our twin sees it."""
    warnings.simplefilter("ignore")
    taken, second = taken_of(folder / f"{label['world']}.npz")
    assert second is not None
    with one_thread():
        fitted = study(taken.observation)
        other = transferred(fitted, second)
        able = [effect for effect in able_effects(fitted) if effect.name == label["accepted"][0]]
        if not able:
            return None
        (effect,) = able
        begun = searched(fitted, able)[effect.name]
        shown = Elsewhere.of(other.study(fitted)).suggests(effect.name, begun.where)
        anew = afresh(fitted, replace(fitted.plain, effects=(effect,), where=begun.where), shown)
        plain = refit(fitted, {name: anew.values[name] for name in fitted.base.values})
        with_it = confirm(fitted, plain, (effect,), begun.vector, begun.where, anew)
        refitted = other.forecast(plain.hypothesis, plain.estimate.values)
        left = plain.estimate.cost, with_it.estimate.cost
        here, there = closure(fitted, plain, with_it), transfer(fitted, other, refitted, with_it)
        return Known(label, left, here.closure, there.closure, widths_off(label, with_it))


def widths_off(label: Label, found: Confirmed) -> dict[str, float]:
    """How far strengths are from the truth, over how far their intervals reach to that side.

    Both as a fit moves them: logarithms of what spans decades. Only of those by which label and law mean the
    same; at 1 the truth is just within.
    """
    name = label["accepted"][0]
    effect = next((one for one in label["effects"] if one["name"] == name), None)
    if effect is None or name not in TRUE_VALUES:  # a hand that is late by itself is no effect of the world
        return {}
    coordinates, values, off = found.misfit.coordinates, found.estimate.values, {}
    for quantity, true in TRUE_VALUES[name](effect).items():
        key = f"{name}.{quantity}"
        low, high = found.intervals[key]
        place = coordinates.names.index(key)
        at, right, below, above = (
            float(coordinates.vector({**values, key: value})[place])
            for value in (values[key], true, low, high)
        )
        reach = above - at if right > at else at - below
        off[quantity] = abs(right - at) / max(reach, 1e-9)
    return off


def told(kept: list[Known], label: Label, folder: Path) -> str:
    """What is printed of a world, which is kept for the summary."""
    found = known(label, folder)
    if found is None:
        return f"| {label['world']} | {label['kind']} | {label['accepted'][0]} | cannot act |"
    kept.append(found)
    return found.row


def summary(every: Sequence[Known]) -> list[str]:
    """Means and medians of all of them, and of those by which a benchmark judges."""
    clear = [one for one in every if (one.label.get("magnitude") or 0.0) >= CLEAR]
    off = sorted(value for one in every for value in one.off.values())
    lines = [
        f"{len(every)} worlds: {_folds(every)}",
        f"{len(clear)} of signal-to-noise {CLEAR:g} or more: {_folds(clear) if clear else 'nothing to tell'}",
        f"{sum(one <= 1.0 for one in off)} of {len(off)} intervals of strengths hold the truth",
    ]
    if off:
        lines[-1] += f", nine of ten {np.quantile(off, 0.9, method='higher'):.1f} times as wide"
    return lines


def _folds(some: Sequence[Known]) -> str:
    """How much less is left with the effects, and later and elsewhere foretold."""
    pairs = {
        "of what is left": [one.left for one in some],
        "of the error later": [_millimetres(one.here) for one in some],
        "elsewhere": [_millimetres(one.there) for one in some],
    }
    folds = [f"{np.mean([np.log(a / b) for a, b in of_it]):.2f} {name}" for name, of_it in pairs.items()]
    closed = [one.there.closed_fraction for one in some if one.there.closed_fraction is not None]
    worse = sum(b > a for a, b in pairs["elsewhere"])
    median = f"{np.median(closed):.2f}" if closed else "nothing"
    return (
        f"e-folds explained {', '.join(folds)}; closed elsewhere, median {median} of {len(closed)}; "
        f"{worse} are worse there with it"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a row for each world, and a summary."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("worlds", type=Path, nargs="+")
    ask_kinds(parser)
    options = parser.parse_args(arguments)
    jobs = [
        (label, folder)
        for folder in options.worlds
        for label in open_labels_of(folder, parser, "it asks of")
        if label["kind"] in options.kind
        and label["accepted"][0] in EFFECT_NAMES
        and seen(label.get("magnitude"))
    ]
    print(f"{HEADER}\n{'|---' * (HEADER.count('|') - 1)}|", flush=True)
    kept: list[Known] = []
    for label, folder in jobs:
        print(told(kept, label, folder), flush=True)
    if kept:
        print("\n".join(summary(kept)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
