"""Make the weights by which a diagnosis judges what its fits explain.

    python -m benchmarks.gap.weighing out/told/clear out/told/dev --out model/gap/weighing.json

Eleven weights are fitted to accounts (`benchmarks/gap/accounts.py`). It says how well they do on worlds that
they have not seen: one at a time, all of one shape, with one effect, or by one generator; how well those do
that ship; and what healthy twins leave, which a verdict takes for usual (`RESIDUE`, `WIDTH` and `HEALTHY` in
`model/gap/weighing.py`).
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path

import numpy as np
from jaxtyping import Float64
from scipy.optimize import brentq, minimize
from scipy.special import logsumexp
from scipy.stats import iqr, norm, spearmanr

from benchmarks.gap.accounts import Told, once, told_in
from model.gap.account import Account
from model.gap.benchmark.scores import calibration_error
from model.gap.classifier import NONE, UNKNOWN
from model.gap.schema import EFFECT_NAMES, VerdictName
from model.gap.verdict import Judged
from model.gap.weighing import Weighing, unexplained
from model.types import Array

USUAL = Weighing(
    effect=-5.0,
    fitted=2.0,
    later=2.0,
    elsewhere=2.0,
    slowly=2.0,
    slowly_elsewhere=2.0,
    harm=4.0,
    buckling=-4.0,
    unknown=-2.0,
    left=1.0,
    flexible=2.0,
)
"""What weights are before any world was seen: three e-folds explained make up for how rare each effect is."""
COMMON: Mapping[VerdictName | None, float] = {NONE: 0.4, None: 0.45, UNKNOWN: 0.15}
"""How often nothing, an effect (no matter which) or something unknown is what is right: worlds to learn from
are picked, and count as if they came so."""
STIFF = 0.2
"""How much a weight costs that is one away from that, in nats."""
EXPLAINING = ("fitted", "later", "elsewhere", "slowly", "slowly_elsewhere", "harm", "flexible")
"""No answer is believed less for explaining more."""
TENTH = 0.1
"""Share of what a flexible force explains from which on it is counted that no effect explains it."""
RESIDUES = (1e-3, 1e3)
"""Over the noise: less and more than any twin leaves beside what it leaves of other lattices."""
ANSWERS: tuple[VerdictName, ...] = (*EFFECT_NAMES, NONE, UNKNOWN)


def learned(worlds: Sequence[Told]) -> Weighing:
    """The weights under which what is right is likeliest, near the usual ones where worlds do not say."""
    before = np.array([getattr(USUAL, field.name) for field in fields(Weighing)])
    slopes, offsets = _linear([one.account for one in worlds])
    right = np.array([[name in one.right for name in ANSWERS] for one in worlds]).reshape(len(worlds), -1)
    counts = Counter(one.kind for one in worlds)
    whole = sum(COMMON[kind] for kind in counts)
    worth = np.array([COMMON[one.kind] / whole / counts[one.kind] for one in worlds]) * len(worlds)

    def cost(weights: Float64[Array, " k"]) -> tuple[float, Float64[Array, " k"]]:
        scores = slopes @ weights + offsets
        chances = np.exp(scores - logsumexp(scores, axis=1, keepdims=True))
        among = np.where(right, chances, 0.0)
        share = among.sum(1, keepdims=True)
        slope = np.einsum("w,wa,wak->k", worth, chances - among / share, slopes)
        apart = weights - before
        return float(STIFF * (apart**2).sum() - worth @ np.log(share[:, 0])), slope + 2.0 * STIFF * apart

    names = [field.name for field in fields(Weighing)]
    bounds = [(0.0 if name in EXPLAINING else None, None) for name in names]
    return Weighing(*minimize(cost, before, jac=True, method="L-BFGS-B", bounds=bounds).x.tolist())


def _linear(accounts: Sequence[Account]) -> tuple[Float64[Array, "w a k"], Float64[Array, "w a"]]:
    """Slopes of all scores along the weights, and what they are without any."""
    count = len(fields(Weighing))

    def table(weights: Float64[Array, " k"]) -> Float64[Array, "w a"]:
        scores = [Weighing(*weights.tolist()).scores(account) for account in accounts]
        return np.array([[one[name] for name in ANSWERS] for one in scores]).reshape(len(accounts), -1)

    offsets = table(np.zeros(count))
    return np.stack([table(unit) - offsets for unit in np.eye(count)], axis=-1), offsets


def chance_of(judged: Judged, one: Told) -> float:
    """Of what is right."""
    return sum(judged.chances[name] for name in one.right)


def unseen(worlds: Sequence[Told], part: Callable[[Told], str]) -> Iterator[tuple[Told, Judged]]:
    """Each world judged by weights that were learned from those of other parts."""
    for name in sorted({part(one) for one in worlds}):
        weighing = learned([one for one in worlds if part(one) != name])
        yield from ((one, weighing.judged(one.account)) for one in worlds if part(one) == name)


def scores(judged: Sequence[tuple[Told, Judged]]) -> dict[str, float]:
    """Of worlds that were not learned from."""
    sure = np.array([verdict.chances[verdict.best] for _, verdict in judged])
    right = np.array([verdict.best in one.right for one, verdict in judged])
    third = np.array([bool(set(verdict.ranked[:3]) & set(one.right)) for one, verdict in judged])
    healthy = np.array([one.kind == NONE for one, _ in judged])
    strange = np.array([one.kind == UNKNOWN for one, _ in judged])
    effects = ~healthy & ~strange
    return {
        "worlds": float(len(judged)),
        "right": float(right.mean()),
        "top-1 of effects": _mean(right[effects]),
        "top-3 of effects": _mean(third[effects]),
        "false alarms": _mean(~right[healthy]),
        "recall of unknown": _mean(right[strange]),
        "ECE": calibration_error(sure.tolist(), right.tolist()).value,
        "nats": float(-np.mean([np.log(max(chance_of(verdict, one), 1e-9)) for one, verdict in judged])),
    }


def _mean(values: Array) -> float:
    return float(values.mean()) if len(values) else float("nan")


def usual(worlds: Sequence[Told]) -> dict[str, tuple[float, float, int]]:
    """What plain twins leave where nothing is missing, by shape.

    What a twin leaves is told against it (`beyond`) where nobody knows what other lattices leave.

    Returns:
        Median of the logarithm, the standard deviation of a normal distribution with the same quartiles, and
        of how many recordings.
    """
    left: dict[str, list[float]] = {}
    for one in once(worlds):
        if one.kind == NONE:
            left.setdefault(one.account.shape, []).extend(np.log(one.account.left))
    found: dict[str, tuple[float, float, int]] = {}
    for shape, each in sorted(left.items()):
        width = float(iqr(each, scale="normal"))
        if width > 0.0:
            found[shape] = (float(np.median(each)), width, len(each))
    return found


def beside_lattices(worlds: Sequence[Told]) -> Float64[Array, "n 2"]:
    """What twins leave where nothing is missing, and what they leave of themselves on other lattices."""
    pairs = [
        (left, lattices)
        for one in once(worlds)
        if one.kind == NONE
        for left, lattices in zip(one.account.left, one.account.lattices, strict=False)
        if lattices is not None
    ]
    return np.array(pairs).reshape(-1, 2)


def usual_beside_lattices(pairs: Float64[Array, "n 2"]) -> tuple[float, float]:
    """How much plain twins leave where nothing is missing beside what they leave of other lattices.

    Args:
        pairs: From `beside_lattices`.

    Returns:
        That, over the noise, with which half of the recordings leave less in all; and the standard deviation
        of a normal distribution with the same tenths at its ends of the logarithm of what is left over that:
        estimates by two lattices have long tails.
    """
    left, lattices = pairs.T

    def over(residue: float) -> Float64[Array, " n"]:
        logarithm: Float64[Array, " n"] = np.log(left) - np.log(np.exp(residue) + lattices)
        return logarithm

    residue = float(brentq(lambda each: np.median(over(each)), *np.log(RESIDUES)))
    width = iqr(over(residue), rng=(10, 90), scale=2.0 * norm.ppf(0.9))
    return float(np.exp(residue)), float(width)


def left_over(worlds: Sequence[Told]) -> dict[str, list[float]]:
    """Of what a flexible force explains the share that no effect does, of worlds of each kind."""
    names = {NONE: "where nothing is missing", None: "with an effect", UNKNOWN: "with something else"}
    shares: dict[str, list[float]] = {}
    for one in once([one for one in worlds if one.account.flexible is not None]):
        shares.setdefault(names[one.kind], []).append(unexplained(one.account))
    return shares


def learn(folders: Sequence[Path], out: Path | None) -> None:
    """Train, say how well it does on worlds it has not seen, write the weights."""
    both = told_in(folders)
    parts: dict[str, Callable[[Told], str]] = {
        "one world at a time": lambda one: one.world,
        "a whole shape": lambda one: one.account.shape,
        "a whole effect": lambda one: one.right[0] if one.right[0] in EFFECT_NAMES else one.world,
        "a whole generator": lambda one: one.generator,
    }
    header = ["left out", "given", *scores([(both[0], USUAL.judged(both[0].account))])]
    print(f"| {' | '.join(header)} |\n{'|---' * len(header)}|")
    for title, part in parts.items():
        if len({part(one) for one in both}) >= 2:
            _row(title, list(unseen(both, part)))
    # which may have been learned from some of these worlds
    _row("nothing: the weights that ship", [(one, Weighing.shipped().judged(one.account)) for one in both])
    for shape, (median, width, count) in usual(both).items():
        print(f"{shape}: ln of what healthy twins leave in {count} recordings {median:.2f} ± {width:.2f}")
    pairs = beside_lattices(both)
    if len(pairs):
        residue, width = usual_beside_lattices(pairs)
        alike = spearmanr(pairs).statistic
        print(f"healthy twins leave what they do on other lattices and {residue:.2f}, ± {width:.2f} of ln")
        print(f"in {len(pairs)} recordings; the rank correlation of the two is {alike:.2f}")
    for name, shares in left_over(both).items():
        much = sum(share > TENTH for share in shares)
        told = f"{much} of {len(shares)} worlds {name}"
        print(f"no effect explains a tenth of what a flexible force does, or more, in {told}")
    weighing = learned(both)
    print({name: round(value, 2) for name, value in asdict(weighing).items()})
    if out is not None:
        worlds, groups = {one.world for one in both}, {one.group for one in both}
        about = {"worlds": len(worlds), "folders": sorted(groups)}
        weights = {name: round(value, 4) for name, value in asdict(weighing).items()}
        out.write_text(json.dumps({"learned from": about, "weights": weights}, indent=1) + "\n")
        print(f"wrote {out}")


def _row(title: str, judged: Sequence[tuple[Told, Judged]]) -> None:
    """Print how well worlds were judged, with one recording and with two."""
    for given, count in (("one recording", 1), ("two", 2)):
        some = [pair for pair in judged if len(pair[0].account.left) == count]
        if some:
            worlds, *values = scores(some).values()
            cells = [title, given, f"{worlds:.0f}", *(f"{value:.2f}" for value in values)]
            print(f"| {' | '.join(cells)} |")


def main(arguments: Sequence[str] | None = None) -> int:
    """Train."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", type=Path, nargs="+", help="where the accounts are")
    parser.add_argument("--out", type=Path, help="of the weights; without it, the tables alone")
    options = parser.parse_args(arguments)
    empty = [str(folder) for folder in options.folders if not any(folder.glob("*.json"))]
    if empty:
        parser.error(f"nothing gathered in {', '.join(empty)}")
    learn(options.folders, options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
