"""What a diagnosis found, as its report, its figures and what it adds to a twin."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from model.gap.account import Account
from model.gap.acts_on import Acting
from model.gap.carried import idle, record_of
from model.gap.closure import Closed
from model.gap.confirm import Confirmed, Fitted
from model.gap.evidence import Evidence
from model.gap.forecast import Forecast, forecast
from model.gap.locate import Located
from model.gap.report.findings import Findings
from model.gap.schema import (
    EFFECT_NAMES,
    SCHEMA,
    EffectFinding,
    FittedQuantity,
    Gap,
    GapReport,
    Verdict,
    Where,
)
from model.gap.signs import Signs
from model.gap.sources import sources
from model.gap.study import Study
from model.gap.verdict import Judged, alike
from model.gap.world import World
from model.schema import EffectName, EffectRecord
from model.types import Array


@dataclass(frozen=True)
class Tried:
    """What was fitted on top of the plain twin."""

    verdict: Judged
    confirmed: Mapping[EffectName, Confirmed]
    """By the name of the one effect."""
    second: EffectName | None
    chosen: Confirmed | None
    """Of the verdict, with one effect or two; None: it names none."""
    acting: Acting | None
    """Where the verdict's effect acts."""
    account: Account
    """What the verdict was made of."""

    def fit_of(self, name: EffectName) -> Confirmed | None:
        """The fit that an effect's numbers are of: the verdict's, if it is one of its effects."""
        if self.chosen is not None and any(effect.name == name for effect in self.chosen.hypothesis.effects):
            return self.chosen
        return self.confirmed.get(name)


@dataclass(frozen=True)
class Found:
    """All that a report is written of."""

    study: Study
    plain: Fitted
    """The refitted twin."""
    tried: Tried
    signs: Signs
    evidence: Evidence
    located: Located
    here: Closed
    there: Closed | None
    """On another interaction; None: there is none."""

    def report(self) -> GapReport:
        """Contract 5."""
        tried, chosen = self.tried, self.tried.chosen
        left = chosen or self.plain
        count = self.study.observation.points.shape[1]
        return GapReport(
            schema=SCHEMA,
            verdict=Verdict(
                effect=tried.verdict.best,
                second=tried.second,
                probability=tried.verdict.chances[tried.verdict.best],
            ),
            gap=Gap(
                **self.here.closure.model_dump(), transfer=None if self.there is None else self.there.closure
            ),
            effects=tuple(self._finding(name) for name in tried.verdict.ranked),
            where=Where(
                points=tuple(self.located.points.tolist()),
                frames=tuple(self.located.frames.tolist()),
                parts=self.located.parts,
                phases=self.located.phases,
                acts_on=(0.0,) * count if tried.acting is None else tuple(tried.acting.points.tolist()),
            ),
            sources=sources(self.here.closure, self.study, left.hypothesis, left.estimate, self._first()),
            warnings=self._warnings(),
        )

    def _first(self) -> float | None:
        """Error on held-out time with the first of two effects alone [m]; None: there are no two."""
        chosen = self.tried.chosen
        if chosen is None or len(chosen.hypothesis.effects) < 2:
            return None
        first = chosen.hypothesis.effects[0].name
        return next((one.foretold.error for name, one in self.tried.confirmed.items() if name == first), None)

    def _finding(self, name: EffectName) -> EffectFinding:
        chance = self.tried.verdict.chances[name]
        same = alike(self.evidence, self.signs, name)
        one = self.tried.fit_of(name)
        if one is None:
            return EffectFinding(name=name, probability=chance, confused_with=same)
        values = one.estimate.values
        (effect,) = (effect for effect in one.hypothesis.effects if effect.name == name)
        parameters = {
            quantity: FittedQuantity(
                value=values[f"{name}.{quantity}"],
                unit=about.unit,
                ci95=one.intervals.get(f"{name}.{quantity}"),
            )
            for quantity, about in effect.quantities.items()
        }
        return EffectFinding(
            name=name,
            probability=chance,
            heldout_error_m=one.foretold.error,
            evidence=one.evidence,
            parameters=parameters,
            confused_with=same,
        )

    def _warnings(self) -> tuple[str, ...]:
        chosen = self.tried.chosen
        said = [
            f"a hand {away:.2g} m from what was seen of the object in the first frame is taken to hold "
            "nothing: nothing that was seen goes with it"
            for away in self.study.plain.twin.idle
        ]
        said += [
            f"{name}, which the twin carries, cannot act in this recording: it is left out"
            for name in idle(self.plain.world, self.study.plain.twin.carried)
        ]
        said += self.located.warnings
        if self.tried.account.of_lattice:
            said.append(
                "twins that differ from this one by nothing but their lattice follow each other here about "
                "as badly as it follows what was seen (it folds, topples or whips): what is left tells "
                "little of what is missing, and a calmer motion would tell more"
            )
        idle_there = self.there is not None and self.there.idle
        if idle_there and chosen is not None:
            said.append(
                f"{chosen.hypothesis.effects[0].name} cannot act in the other interaction, which says "
                "nothing of it"
            )
        if chosen is not None:
            effect = chosen.hypothesis.effects[0]
            for name in alike(self.evidence, self.signs, effect.name):
                motion = effect.confused_with.get(name)
                tail = f": {motion} to tell them apart" if motion else ""
                said.append(f"this recording cannot tell {effect.name} from {name}{tail}")
            acting, where = self.tried.acting, chosen.hypothesis.where
            alone = len(chosen.hypothesis.effects) == 1  # two are fitted everywhere
            if acting is not None and acting.local and where is None and alone:
                said.append(
                    "where it acts (`where.acts_on`) is told by a linear test: fitted there alone it leaves "
                    "no less, so its strength, and a saved twin, are of it acting everywhere"
                )
            for quantity in chosen.at_bound:
                said.append(
                    f"the fit drove {quantity} to its bound: take its value for a direction, not a number"
                )
            if chosen.foretold.error >= self.plain.foretold.error:
                said.append(
                    f"{effect.name} does not shrink the error on held-out time: it fits, it does not foretell"
                )
            other = None if self.there is None else self.there.closure
            helps = other is None or other.with_effect is None or other.with_effect < other.refit
            if not helps and not idle_there:
                said.append(
                    f"{effect.name} does not shrink the error on the other interaction: doubt the verdict"
                )
        missing = [name for name in EFFECT_NAMES if name not in self.signs.names]
        if missing:
            names = ", ".join(missing)
            said.append(f"could not act on this twin in this recording, so nothing is known of: {names}")
        return tuple(said)

    def findings(self) -> Findings:
        """The report and what its figures show: free runs like those that the errors are of."""
        fitted, chosen = self.study, self.tried.chosen
        seen = fitted.observation
        came = self._forecast(fitted.plain.at(fitted.start))
        before = self._forecast(self.plain.world)
        after = None if chosen is None else self._forecast(chosen.world)
        world = self.plain.world
        rest = world.sight(world.system.points).double().numpy()
        return Findings(
            report=self.report(),
            times=seen.times,
            observed=seen.points,
            before=np.concatenate([rest[None], before.points]),
            error_baseline=_per_frame(came),
            error_refit=_per_frame(before),
            rest=rest,
            controllers=seen.controllers[:, fitted.plain.twin.holders],
            after=None if after is None else np.concatenate([rest[None], after.points]),
            error_after=None if after is None else _per_frame(after),
            ground_height=seen.ground_height,
            intervals=self.here.intervals,
            transfer_intervals={} if self.there is None else self.there.intervals,
        )

    def records(self) -> tuple[EffectRecord, ...]:
        """What the verdict adds to a twin."""
        chosen = self.tried.chosen
        if chosen is None:
            return ()
        values = chosen.estimate.values
        return tuple(
            record_of(
                effect,
                {name: values[f"{effect.name}.{name}"] for name in effect.quantities},
                chosen.hypothesis.where,
                {
                    name: chosen.intervals[f"{effect.name}.{name}"]
                    for name in effect.quantities
                    if f"{effect.name}.{name}" in chosen.intervals
                },
            )
            for effect in chosen.hypothesis.effects
        )

    def own_values(self) -> dict[str, float] | None:
        """Parameters of the twin that were fitted together with the effects."""
        chosen = self.tried.chosen
        return None if chosen is None else dict(chosen.estimate.values)

    def _forecast(self, world: World) -> Forecast:
        return forecast(self.study.observer, world, 1)


def _per_frame(one: Forecast) -> Float64[Array, " T"]:
    return np.concatenate([[np.nan], one.of_frames])
