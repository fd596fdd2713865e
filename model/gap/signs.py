"""What a recording shows of each effect, as numbers that mean the same for all effects and objects."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from model.gap.evidence import BLOCKS, Evidence
from model.gap.schema import EFFECT_NAMES
from model.schema import EffectName
from model.types import Array

RIDGE = 1e-3
"""Of the columns, relative to their size."""
SIGN_NAMES = (
    "foretold",
    "foretold beside sensors",
    "all probes",
    "gain",
    "beside the best other",
    "lead",
    "near the grip",
    "strength",
    "plausible",
)
CONTEXT_NAMES = (
    "log misfit",
    "sensors",
    "hand",
    "all effects",
    "best",
    "second",
    "rope",
    "sheet",
    "ground",
    "held",
    "two interactions",
)


@dataclass(frozen=True)
class Signs:
    """Of one recording."""

    names: tuple[EffectName, ...]
    """Effects that could act."""
    each: Float64[Array, "e s"]
    """`SIGN_NAMES` of each effect."""
    context: Float64[Array, " c"]
    """`CONTEXT_NAMES`."""
    probe: Int64[Array, " e"]
    """Column of the evidence whose probe foretells most, of each effect."""
    scale: Float64[Array, " e"]
    """By how much that probe would have to be stronger."""


def signs_of(
    evidence: Evidence, shape: str, cost: float, ground: bool, leaving_out: Sequence[str] = ()
) -> Signs:
    """Score tests of all effects, in all the ways that tell them apart.

    Shares are of what the plain twin leaves once its own parameters have followed, in blocks of time that
    were held out of the test's own fit.

    Args:
        evidence: Inner products of what each probe changes.
        shape: Of the object: rope, sheet or solid.
        cost: Mean square of the innovations over their noise.
        ground: Whether there is one.
        leaving_out: Effects to act as if the catalogue did not have them.
    """
    tests = _Tests(evidence)
    twin, sensor, hand = evidence.of("twin"), evidence.of("sensor"), evidence.of("hand")
    none = ("twin", "sensor", "hand", "plain", *leaving_out)
    names = tuple(name for name in EFFECT_NAMES if name in evidence.kinds and name not in none)
    probed = {name: evidence.of(name) for name in names}
    best = {name: max(probed[name], key=lambda i: tests.foretold(twin, [i])) for name in names}
    foretold = {name: tests.foretold(twin, [best[name]]) for name in names}
    order = sorted(names, key=lambda name: -foretold[name])
    each, scales = [], []
    for name in names:
        i = best[name]
        rival = next((other for other in order if other != name), None)
        beside = twin if rival is None else [*twin, best[rival]]
        lead = foretold[name] - (0.0 if rival is None else foretold[rival])
        gain, scale = tests.gain(twin, [i])
        each.append(
            [
                foretold[name],
                tests.foretold([*twin, *sensor, *hand], [i]),
                tests.foretold(twin, probed[name]),
                gain,
                tests.foretold(beside, [i]),
                lead,
                tests.share_near(twin, [i]),
                np.log1p(abs(scale)),
                float(scale > 0),
            ]
        )
        scales.append(scale)
    everything = [i for name in names for i in probed[name]]
    ranked = [foretold[name] for name in order]
    context = [
        np.log(cost),
        tests.foretold(twin, sensor),
        tests.foretold(twin, hand) if hand else 0.0,
        tests.foretold(twin, everything) if everything else 0.0,
        ranked[0] if ranked else 0.0,
        ranked[1] if len(ranked) > 1 else 0.0,
        float(shape == "rope"),
        float(shape == "sheet"),
        float(ground),
        float(bool(hand)),
        float(len(evidence.grams) > 2 * BLOCKS),
    ]
    table = np.array(each, np.float64).reshape(len(names), len(SIGN_NAMES))
    return Signs(
        names,
        table,
        np.array(context, np.float64),
        np.array([best[name] for name in names], np.int64),
        np.array(scales, np.float64),
    )


class _Tests:
    """Least squares on inner products."""

    def __init__(self, found: Evidence) -> None:
        evidence = found.weighed
        size = np.sqrt(np.maximum(np.diagonal(evidence.grams.sum(0)), 1e-300))
        self.grams = evidence.grams / size / size[:, None]
        self.whole = self.grams.sum(0)
        # near the grip and far from it are two cells of one time
        self.blocks = self.grams[0::2] + self.grams[1::2]
        self.near = self.grams[0::2].sum(0)
        self.size = size
        self._known: dict[tuple[int, ...], float] = {}

    def foretold(self, beside: Sequence[int], tried: Sequence[int]) -> float:
        """Share of the squared innovations in held-out blocks that `tried` explains."""
        before, after = self._held_out(beside), self._held_out([*beside, *tried])
        # a twin whose parameters follow may do worse in a held-out block than one left as it is
        return float(np.clip(1.0 - after / min(before, self.blocks[:, -1, -1].sum()), -1.0, 1.0))

    def gain(self, beside: Sequence[int], tried: Sequence[int]) -> tuple[float, float]:
        """Share that it explains where it was fitted, and how strong the last of `tried` is then."""
        before, _ = self._left(self.whole, self.whole, beside)
        after, strengths = self._left(self.whole, self.whole, [*beside, *tried])
        scale = strengths[-1] * self.size[-1] / max(self.size[tried[-1]], 1e-30)
        return float(1.0 - after / before), float(scale)

    def share_near(self, beside: Sequence[int], tried: Sequence[int]) -> float:
        """How much more of the innovations it explains near the grip than far from it."""

        def explained(part: Array) -> float:
            before = self._left(self.whole, part, beside)[0]
            return 1.0 - self._left(self.whole, part, [*beside, *tried])[0] / max(before, 1e-12)

        return float(np.clip(explained(self.near) - explained(self.whole - self.near), -1.0, 1.0))

    def _held_out(self, columns: Sequence[int]) -> float:
        key = tuple(columns)
        if key not in self._known:
            left = sum(self._left(self.whole - part, part, columns)[0] for part in self.blocks)
            self._known[key] = float(left)
        return self._known[key]

    def _left(self, fitted: Array, judged: Array, columns: Sequence[int]) -> tuple[float, Array]:
        """What is left in `judged` of the innovations by a fit in `fitted`, and the fit's coefficients."""
        some = list(columns)
        normal = fitted[np.ix_(some, some)]
        ridge = RIDGE * np.diag(np.diagonal(normal) + 1e-6)
        strengths = -np.linalg.solve(normal + ridge, fitted[some, -1])
        left = judged[-1, -1] + 2.0 * strengths @ judged[some, -1]
        left += strengths @ judged[np.ix_(some, some)] @ strengths
        return float(left), strengths
