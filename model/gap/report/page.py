"""`report.html`: one file that needs nothing else, on a screen, a phone and paper."""

import base64
import re
import struct
from collections.abc import Iterable, Mapping
from importlib.resources import files
from typing import TypeAlias

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from model.gap.report.figures import ALL_DRAWINGS
from model.gap.report.motions import next_motions
from model.gap.report.sentences import MEANINGS, sentences, title
from model.gap.report.wording import (
    companions,
    listed,
    millimetres,
    number,
    percent,
    percent_range,
    plain,
    with_effect,
)
from model.gap.schema import SOURCE_NAMES, EffectFinding, GapReport
from model.version import __version__

Fields: TypeAlias = dict[str, object]
UNDETERMINED = "–"
UNIT = re.compile(r"(?<=\d) (?=(?:%|mm|s|nats)(?:\W|$))|(?<=[<>]) (?=\d)")
"""The space between a number and what belongs to it."""


def page(report: GapReport, images: Mapping[str, bytes]) -> str:
    """The report as HTML, with its images inside.

    Args:
        report: With its statement.
        images: PNGs by the file names of `ALL_DRAWINGS`.
    """
    own = files("model.gap.report")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    environment.filters["bound"] = bound
    template = environment.from_string((own / "page.html").read_text("utf-8"))
    shown = (report.verdict.effect, report.verdict.second, *companions(report))
    return template.render(
        report=report,
        version=__version__,
        title=title(report),
        css=Markup((own / "page.css").read_text("utf-8")),
        numbers=_numbers(report),
        sentences=sentences(report),
        motions=next_motions(report),
        figures=[_figure(each.heading, each.caption, images[each.file]) for each in ALL_DRAWINGS],
        sources=_sources(report),
        fitted=[_fitted(effect) for effect in report.effects if effect.name in shown and effect.parameters],
        effects=[_effect(effect, effect.name in shown) for effect in report.effects],
    )


def bound(text: str) -> str:
    """Keep numbers and their units on one line."""
    return UNIT.sub("\u00a0", text)


def _numbers(report: GapReport) -> list[Fields]:
    """The figures that come first."""
    gap = report.gap
    tiles: list[Fields] = [
        {
            "role": "came",
            "name": "as it came",
            "value": millimetres(gap.baseline),
            "note": "mean distance, held out",
        },
        {"role": "refit", "name": "refitted", "value": millimetres(gap.refit), "note": "its own parameters"},
    ]
    if gap.with_effect is not None:
        note = "" if gap.closed_fraction is None else f"closes {percent(gap.closed_fraction)}"
        if gap.closed_fraction_ci95 is not None:
            note += f" ({percent_range(gap.closed_fraction_ci95)})"
        value = millimetres(gap.with_effect)
        tiles.append({"role": "effect", "name": with_effect(report), "value": value, "note": note})
    floor = {"role": "floor", "name": "noise floor", "value": millimetres(gap.noise_floor)}
    return [*tiles, {**floor, "note": "what noise alone makes"}]


def _figure(heading: str, caption: str, image: bytes) -> Fields:
    width, height = struct.unpack(">II", image[16:24])
    encoded = base64.b64encode(image).decode("ascii")
    return {"heading": heading, "caption": caption, "base64": encoded, "width": width, "height": height}


def _sources(report: GapReport) -> Iterable[Fields]:
    shares = {name: getattr(report.sources, name) for name in SOURCE_NAMES}
    return [
        {"name": name, "share": percent(share), "width": round(share, 4), "meaning": MEANINGS[name]}
        for name, share in shares.items()
    ]


def _fitted(effect: EffectFinding) -> Fields:
    rows = [
        {
            "name": plain(name),
            "value": number(fitted.value),
            "interval": UNDETERMINED
            if fitted.ci95 is None
            else f"{number(fitted.ci95[0])} to {number(fitted.ci95[1])}",
            "unit": UNDETERMINED if fitted.unit in ("", "1") else fitted.unit,
        }
        for name, fitted in effect.parameters.items()
    ]
    return {"name": plain(effect.name), "rows": rows}


def _effect(effect: EffectFinding, chosen: bool) -> Fields:
    return {
        "name": plain(effect.name),
        "chosen": chosen,
        "probability": percent(effect.probability),
        "error": UNDETERMINED if effect.heldout_error_m is None else millimetres(effect.heldout_error_m),
        "evidence": UNDETERMINED if effect.evidence is None else number(effect.evidence),
        "alike": listed(plain(name) for name in effect.confused_with) if effect.confused_with else "",
    }
