"""The gap report (contract 5, `report.json`) as pydantic records; imports no torch and nothing that does."""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal, TypeAlias, get_args

from pydantic import (
    Field,
    field_validator,
    model_serializer,
    model_validator,
)

from model.schema import EffectName, NonNegative, Record

SCHEMA: Literal["matphys.gap/1"] = "matphys.gap/1"
EFFECT_NAMES: tuple[EffectName, ...] = get_args(EffectName)
TOLERANCE = 1e-3
"""Of a sum of shares or probabilities, and of figures that have to agree."""
ROUNDING = 0.01
"""Of the closed fraction, which people round."""

Share: TypeAlias = Annotated[float, Field(ge=0, le=1)]
Interval: TypeAlias = tuple[float, float]
VerdictName: TypeAlias = Literal[EffectName, "none", "unknown"]
Handler: TypeAlias = Callable[[Any], dict[str, Any]]
SOURCE_NAMES = ("perception", "actuation", "parameters", "physics", "unexplained")


def _ordered(interval: Interval) -> Interval:
    if interval[0] > interval[1]:
        raise ValueError("expected the lower end first")
    return interval


def _sums_to_one(shares: Sequence[float]) -> None:
    if abs(math.fsum(shares) - 1) > TOLERANCE:
        raise ValueError(f"expected shares that sum to 1, they sum to {math.fsum(shares):.6g}")


class Verdict(Record):
    """What is missing in the twin."""

    effect: VerdictName
    """`none`: nothing is missing; `unknown`: something is, and the catalogue does not have it."""
    second: EffectName | None = None
    """Where two effects are at work: the lesser one. Beyond contract 5, and absent unless there is one."""
    probability: Share
    """Of `effect`."""
    statement: str = ""
    """One plain sentence with the numbers; `write_report` fills in one that is empty."""

    @model_validator(mode="after")
    def _pair(self) -> "Verdict":
        if self.second is not None and self.effect in ("none", "unknown", self.second):
            raise ValueError(f"expected a second effect beside another one, the verdict is {self.effect}")
        return self

    @model_serializer(mode="wrap")
    def _without_absent(self, handler: Handler) -> dict[str, Any]:
        return _without(handler(self), "second")


class Closure(Record):
    """How far the gap shrinks, on one interaction: mean distance of visible points on held-out time [m]."""

    metric: Literal["track_error_m"] = "track_error_m"
    baseline: NonNegative
    """The twin as it came, or with its prior parameters."""
    refit: NonNegative
    """The same model, its own parameters refitted: what tuning alone can do."""
    with_effect: NonNegative | None = None
    """The verdict's effect added and fitted; None: the verdict has no effect."""
    noise_floor: NonNegative
    """What no model can beat: measurement noise."""
    ceiling: NonNegative | None = None
    """With a flexible residual force: what any missing physics could explain; None: not determined."""
    closed_fraction: float | None = None
    """(refit − with_effect) / (refit − noise_floor); None: there is no gap that could be reduced."""
    closed_fraction_ci95: Interval | None = None
    heldout: tuple[Interval, ...]
    """Spans of time [s] that no fit has seen."""

    @field_validator("closed_fraction_ci95")
    @classmethod
    def _interval(cls, interval: Interval | None) -> Interval | None:
        return None if interval is None else _ordered(interval)

    @field_validator("heldout")
    @classmethod
    def _spans(cls, spans: tuple[Interval, ...]) -> tuple[Interval, ...]:
        if not spans:
            raise ValueError("expected at least one span that was held out")
        for span in spans:
            _ordered(span)
        return spans

    @model_validator(mode="after")
    def _consistent(self) -> "Closure":
        if self.closed_fraction is None:
            if self.closed_fraction_ci95 is not None:
                raise ValueError("expected no closed_fraction_ci95 without a closed_fraction")
            return self
        if self.with_effect is None:
            raise ValueError("expected no closed_fraction without with_effect")
        reducible = self.refit - self.noise_floor
        if abs(self.closed_fraction * reducible - (self.refit - self.with_effect)) > ROUNDING * self.refit:
            raise ValueError("expected closed_fraction = (refit - with_effect) / (refit - noise_floor)")
        return self


class Gap(Closure):
    """How far the gap shrinks, and whether it does so on another interaction as well."""

    transfer: Closure | None = None
    """The same figures on the second interaction, when one was given; absent otherwise."""

    @model_serializer(mode="wrap")
    def _without_absent(self, handler: Handler) -> dict[str, Any]:
        return _without(handler(self), "transfer")


class FittedQuantity(Record):
    """A fitted parameter of an effect."""

    value: float
    unit: str
    ci95: Interval | None = None
    """None: not determined."""

    @field_validator("ci95")
    @classmethod
    def _interval(cls, interval: Interval | None) -> Interval | None:
        return None if interval is None else _ordered(interval)


class EffectFinding(Record):
    """What was found about one effect of the catalogue."""

    name: EffectName
    probability: Share
    heldout_error_m: NonNegative | None = None
    """With this effect fitted, on held-out time [m]; None: it was not fitted."""
    evidence: float | None = None
    """Held-out log-score over that of the refitted twin [nats]; None: it could not act or was not scored."""
    parameters: dict[str, FittedQuantity] = Field(default_factory=dict)
    confused_with: tuple[EffectName, ...] = ()
    """Effects that this observation cannot tell it from."""

    @model_validator(mode="after")
    def _others(self) -> "EffectFinding":
        if self.name in self.confused_with:
            raise ValueError("expected other effects in confused_with, found its own name")
        return self


class PartShare(Record):
    """Share of the gap that lies in one part."""

    part: str | int
    share: Share


class PhaseShare(Record):
    """Share of the gap that falls into one phase of the motion."""

    name: str
    start_s: float
    end_s: float
    share: Share

    @model_validator(mode="after")
    def _span(self) -> "PhaseShare":
        _ordered((self.start_s, self.end_s))
        return self


class Where(Record):
    """Where the gap lies. N observed points, T frames."""

    points: tuple[Share, ...]
    """Share of the gap per observed point, length N; sums to 1."""
    frames: tuple[Share, ...]
    """Share of the gap per frame, length T; sums to 1."""
    parts: tuple[PartShare, ...] = ()
    """Sum to 1 where there are any."""
    phases: tuple[PhaseShare, ...] = ()
    """Divide the time; sum to 1 where there are any."""
    acts_on: tuple[Share, ...]
    """How strongly the verdict's effect acts on each point, 0..1, length N; zeros where there is none."""

    @field_validator("points", "frames")
    @classmethod
    def _whole(cls, shares: tuple[float, ...]) -> tuple[float, ...]:
        _sums_to_one(shares)
        return shares

    @field_validator("parts", "phases")
    @classmethod
    def _wholes(cls, each: tuple[PartShare | PhaseShare, ...]) -> tuple[PartShare | PhaseShare, ...]:
        if each:
            _sums_to_one([one.share for one in each])
        return each

    @model_validator(mode="after")
    def _lengths(self) -> "Where":
        if len(self.acts_on) != len(self.points):
            count = len(self.points)
            raise ValueError(f"expected {count} values in acts_on as in points, found {len(self.acts_on)}")
        return self


class Sources(Record):
    """Shares of the baseline gap by what causes it; sum to 1."""

    perception: Share
    actuation: Share
    parameters: Share
    physics: Share
    unexplained: Share

    @model_validator(mode="after")
    def _whole(self) -> "Sources":
        _sums_to_one([getattr(self, name) for name in SOURCE_NAMES])
        return self


class GapReport(Record):
    """`report.json`."""

    # The key is `schema`, which is also the name of a method of BaseModel.
    schema_: Literal["matphys.gap/1"] = Field(alias="schema")
    verdict: Verdict
    gap: Gap
    effects: tuple[EffectFinding, ...]
    """Every effect of the catalogue, the most probable first."""
    where: Where
    sources: Sources
    warnings: tuple[str, ...] = ()
    """What this observation cannot tell apart, and which motion would; doubts about the diagnosis."""

    @field_validator("effects")
    @classmethod
    def _ranked(cls, effects: tuple[EffectFinding, ...]) -> tuple[EffectFinding, ...]:
        names = [effect.name for effect in effects]
        if missing := [name for name in EFFECT_NAMES if name not in names]:
            raise ValueError(f"expected every effect of the catalogue, {missing[0]} is missing")
        if len(names) != len(EFFECT_NAMES):
            raise ValueError("expected every effect once")
        chances = [effect.probability for effect in effects]
        if any(later > earlier for earlier, later in itertools.pairwise(chances)):
            raise ValueError("expected the most probable effect first")
        return effects

    @model_validator(mode="after")
    def _agreement(self) -> "GapReport":
        verdict = self.verdict
        if self.named is not None:
            if abs(self.named.probability - verdict.probability) > TOLERANCE:
                raise ValueError(f"expected one probability of {verdict.effect} in verdict and effects")
            if self.effects[0].probability > verdict.probability + TOLERANCE:
                raise ValueError(f"expected no effect more probable than the verdict {verdict.effect!r}")
            if self.gap.with_effect is None:
                raise ValueError(f"expected with_effect for the verdict {verdict.effect!r}")
        # at most one effect is at work, or two where the verdict says so
        if self.remainder < -TOLERANCE:
            raise ValueError("expected probabilities that sum to 1 at most, they sum to more")
        return self

    def finding(self, name: str) -> EffectFinding:
        """What was found about one effect of the catalogue."""
        return next(effect for effect in self.effects if effect.name == name)

    @property
    def named(self) -> EffectFinding | None:
        """The verdict's effect; None where it is `none` or `unknown`."""
        name = self.verdict.effect
        return None if name in ("none", "unknown") else self.finding(name)

    @property
    def remainder(self) -> float:
        """Probability that is left beside the verdict and the effects.

        It belongs to `none` and `unknown`, or to the one of them that is not the verdict. Two effects that
        are at work together may each be probable: what they have more than 1 in sum they share.
        """
        claimed = math.fsum(effect.probability for effect in self.effects)
        left = 1.0 - claimed - (self.verdict.probability if self.named is None else 0.0)
        if self.verdict.second is None or left >= 0.0:
            return left
        return min(left + self.finding(self.verdict.second).probability, 0.0)


def _without(values: dict[str, Any], key: str) -> dict[str, Any]:
    """The values without a key that has none."""
    return {name: value for name, value in values.items() if name != key or value is not None}
