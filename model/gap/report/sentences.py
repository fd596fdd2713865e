"""Where, when and from what source the gap comes, in plain sentences with the numbers first."""

from model.gap.report.statement import may_hide
from model.gap.report.wording import (
    LIKELY,
    added,
    certainty,
    companions,
    listed,
    millimetres,
    percent,
    plain,
)
from model.gap.schema import SOURCE_NAMES, GapReport

MEANINGS = {
    "perception": "noise of the tracking, and what a wrong scale or a slow drift of it would explain",
    "actuation": "the hand was not where it was said to be",
    "parameters": "gone once the twin's own parameters are refitted",
    "physics": "effects that the twin does not have",
    "unexplained": "left after everything that was tried",
}
CONCENTRATED = 0.5
"""Share of the gap whose extent on the object is told."""
EVERYWHERE = 0.95


def sentences(report: GapReport) -> tuple[str, ...]:
    """What a reader should know after the verdict."""
    return tuple(
        text
        for text in (_tuning(report), _place(report), _time(report), _acting(report), _source(report))
        if text
    )


def title(report: GapReport) -> str:
    """The verdict in a few words."""
    sure = certainty(report) >= LIKELY
    if report.verdict.effect == "none":
        found = "no missing effect stands out" if may_hide(report) else "nothing is missing"
        return f"{found[0].upper()}{found[1:]}" if sure else f"Likeliest: {found}"
    if report.verdict.effect == "unknown":
        return "Something unknown is missing" if sure else "Likeliest: something unknown is missing"
    names = [plain(report.verdict.effect), *(plain(name) for name in companions(report))]
    missing = listed(names, "or") if report.verdict.second is None else str(added(report))
    return f"Missing: {missing}" if sure else f"Likeliest to be missing: {missing}"


def _tuning(report: GapReport) -> str:
    gap = report.gap
    saved = 1.0 - gap.refit / gap.baseline if gap.baseline > 0 else 0.0
    if saved <= -0.02:
        return (
            "Refitting the twin's own parameters makes the error on held-out time larger"
            f" ({millimetres(gap.baseline)} to {millimetres(gap.refit)})."
        )
    if saved < 0.02:
        return (
            "Refitting the twin's own parameters does not help on held-out time, whatever it does where it is"
            f" fitted: {millimetres(gap.refit)} remain."
        )
    return (
        f"Refitting the twin's own parameters alone takes {percent(saved)} of the error on held-out time away"
        f" ({millimetres(gap.baseline)} to {millimetres(gap.refit)})."
    )


def _place(report: GapReport) -> str:
    shares = sorted(report.where.points, reverse=True)
    summed, count = 0.0, 0
    while summed < CONCENTRATED * sum(shares) and count < len(shares):
        summed, count = summed + shares[count], count + 1
    text = f"Half of the gap lies on {percent(count / len(shares))} of the points"
    if report.where.parts:
        worst = max(report.where.parts, key=lambda part: part.share)
        name = f"part {worst.part}" if isinstance(worst.part, int) else f"the part “{worst.part}”"
        text += f"; {percent(worst.share)} of it on {name}"
    return f"{text}."


def _time(report: GapReport) -> str:
    if not report.where.phases:
        return ""
    worst = max(report.where.phases, key=lambda phase: phase.share)
    return (
        f"{percent(worst.share)} of the gap falls into the phase “{plain(worst.name)}”"
        f" ({worst.start_s:.2f} s to {worst.end_s:.2f} s)."
    )


def _acting(report: GapReport) -> str:
    acts = report.where.acts_on
    if report.named is None or not any(acts):
        return ""
    strong = sum(value >= 0.5 for value in acts) / len(acts)
    # of two effects the place is told of the first
    acting = f"{plain(report.named.name).capitalize()} acts"
    if strong >= EVERYWHERE:
        return f"{acting} on the whole object."
    return f"{acting} mainly on {percent(strong)} of the points."


def _source(report: GapReport) -> str:
    shares = {name: getattr(report.sources, name) for name in SOURCE_NAMES}
    name = max(shares, key=lambda each: shares[each])
    return (
        f"{percent(shares[name])} of what the twin was off by before any refit, squared, on held-out time, is"
        f" {name}: {MEANINGS[name]}."
    )
