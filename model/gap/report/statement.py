"""The verdict as one plain sentence."""

from model.gap.report.wording import (
    LIKELY,
    added,
    certainty,
    companions,
    listed,
    millimetres,
    percent,
    percent_range,
    plain,
    verb,
)
from model.gap.schema import GapReport

UNSEEN = 3.0
"""A twin that is off by more times the noise may lack something that does not stand out."""
TUNED = 1.2
"""A twin that came with more times its refitted error was badly tuned, which is worth a word."""


def statement(report: GapReport) -> str:
    """One plain sentence with the numbers: what is missing, how sure that is, how far the gap shrinks."""
    if report.verdict.effect == "none":
        return _nothing(report)
    if report.verdict.effect == "unknown":
        return _unknown(report)
    return _cause(report) + _shrinkage(report) + "."


def stated(report: GapReport) -> GapReport:
    """The report, with a statement where it had none."""
    if report.verdict.statement:
        return report
    verdict = report.verdict.model_copy(update={"statement": statement(report)})
    return report.model_copy(update={"verdict": verdict})


def may_hide(report: GapReport) -> bool:
    """Whether the twin is off by so much that it may lack something that does not stand out."""
    return report.gap.refit > UNSEEN * report.gap.noise_floor


def _cause(report: GapReport) -> str:
    name, sure = added(report), percent(report.verdict.probability)
    alike = companions(report)
    if not alike:
        subject = f"{str(name).capitalize()} {verb(report, 'is', 'are')}"
        if report.verdict.probability < LIKELY:
            return f"{subject} the likeliest thing that the twin lacks ({sure} sure)"
        return f"{subject} missing in the twin ({sure} sure)"
    names = listed((plain(report.verdict.effect), *map(plain, alike)), "or")
    chance = certainty(report)
    together = percent(min(1.0, chance))
    beside = "" if report.verdict.second is None else f", beside {plain(report.verdict.second)}"
    lack = "is missing in the twin"
    if chance < LIKELY:
        lack = "is the likeliest thing that the twin lacks"
    return (
        f"{names.capitalize()} {lack} ({together} sure){beside}; this recording cannot tell"
        f" them apart, {plain(report.verdict.effect)} is the likeliest ({sure})"
    )


def _shrinkage(report: GapReport) -> str:
    gap = report.gap
    assert gap.with_effect is not None
    several = companions(report) or report.verdict.second is not None
    change = "falls" if gap.with_effect < gap.refit else "goes"
    text = (
        f": with {added(report) if several else 'it'} the error on held-out time {change} from"
        f" {millimetres(gap.refit)} after refitting to {millimetres(gap.with_effect)}"
    )
    if gap.closed_fraction is None:
        return (
            f"{text}; the gap is too small against noise ({millimetres(gap.noise_floor)}) to say what share"
            f"{_elsewhere(report)}"
        )
    if gap.closed_fraction <= 0.0:
        return f"{text}, which closes nothing of the reducible gap{_elsewhere(report)}"
    share = f"{percent(gap.closed_fraction)} of the reducible gap"
    if gap.closed_fraction_ci95 is not None:
        share += f" (95 % interval {percent_range(gap.closed_fraction_ci95)})"
    return f"{text}, which closes {share}{_elsewhere(report)}"


def _elsewhere(report: GapReport) -> str:
    other = report.gap.transfer
    if other is None or other.with_effect is None:
        return ""
    if other.with_effect == other.refit:
        return (
            f"; on the other interaction, where it does not act, the error stays {millimetres(other.refit)}"
        )
    if other.with_effect > other.refit:
        change = f"{millimetres(other.refit)} to {millimetres(other.with_effect)}"
        return f"; on the other interaction it helps nothing ({change})"
    if other.closed_fraction is None:
        return "; on the other interaction the gap is too small against noise to say"
    return f", and {percent(other.closed_fraction)} on the other interaction"


def _nothing(report: GapReport) -> str:
    gap = report.gap
    tuned = (
        f"once its own parameters are refitted (it came with {millimetres(gap.baseline)}) "
        if gap.baseline > TUNED * gap.refit
        else ""
    )
    if may_hide(report):
        return (
            f"No missing effect stands out in this recording ({percent(report.verdict.probability)} sure"
            f" that none is at work): {tuned}the twin is off by {millimetres(gap.refit)} on held-out time,"
            f" where measurement noise alone makes {millimetres(gap.noise_floor)}; a twin that lacks nothing"
            " but the true mesh may leave as much."
        )
    sure = percent(report.verdict.probability)
    said = f"Nothing is missing in the twin ({sure} sure)"
    if report.verdict.probability < LIKELY:
        said = f"That nothing is missing in the twin is the likeliest answer ({sure} sure)"
    return (
        f"{said}: {tuned}it is off by"
        f" {millimetres(gap.refit)} on held-out time, and measurement noise alone makes"
        f" {millimetres(gap.noise_floor)}."
    )


def _unknown(report: GapReport) -> str:
    gap = report.gap
    sure = percent(report.verdict.probability)
    said = "Something is missing in the twin that the catalogue does not have"
    if report.verdict.probability < LIKELY:
        said = "The likeliest answer is that the twin lacks something that the catalogue does not have"
    text = (
        f"{said} ({sure} sure): after refitting it is off by"
        f" {millimetres(gap.refit)} on held-out time, where noise alone makes {millimetres(gap.noise_floor)}"
    )
    if gap.ceiling is not None:
        text += f" and a free force would leave {millimetres(gap.ceiling)}"
    tried = {e.name: e.heldout_error_m for e in report.effects if e.heldout_error_m is not None}
    if tried:
        name, left = min(tried.items(), key=lambda each: each[1])
        text += f"; the best known effect, {plain(name)}, leaves {millimetres(left)}"
    return f"{text}."
