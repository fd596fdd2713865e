"""Names and numbers as people read them."""

from collections.abc import Iterable, Sequence

from model.gap.schema import GapReport

REFITTED = "refitted twin"
LIKELY = 0.5
"""What is less probable is not said outright."""


def plain(name: str) -> str:
    """`quadratic_air_drag` → `quadratic air drag`."""
    return name.replace("_", " ")


def number(value: float) -> str:
    """Three significant digits, without an exponent where it stays readable.

    >>> number(0.03141), number(21.0), number(123456.0), number(1.2e-5)
    ('0.0314', '21', '123000', '1.2e-5')
    """
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 1e6:
        rounded = float(f"{value:.3g}")
        return f"{rounded:.6f}".rstrip("0").rstrip(".").replace("-", "−")
    mantissa, exponent = f"{value:.2e}".split("e")
    return f"{mantissa.rstrip('0').rstrip('.')}e{int(exponent)}".replace("-", "−")


def millimetres(metres: float) -> str:
    """A distance, two or three digits.

    >>> millimetres(0.0214), millimetres(0.0031), millimetres(0.00052)
    ('21.4 mm', '3.1 mm', '0.52 mm')
    """
    value = 1e3 * metres
    return f"{value:.0f} mm" if value >= 100 else f"{value:.1f} mm" if value >= 1 else f"{value:.2f} mm"


def percent(share: float) -> str:
    """A share; what is neither nothing nor all is not shown as such.

    >>> percent(0.853), percent(0.004), percent(0.9991), percent(0.0), percent(1.0)
    ('85 %', '< 1 %', '> 99 %', '0 %', '100 %')
    """
    if 0 < share < 0.005:
        return "< 1 %"
    if 0.995 < share < 1:
        return "> 99 %"
    return f"{_hundredths(share)} %"


def percent_range(interval: tuple[float, float]) -> str:
    """`81–88 %`, of an interval of shares."""
    low, high = (_hundredths(end) for end in interval)
    return f"{low} to {high} %" if low.startswith("−") else f"{low}–{high} %"


def _hundredths(share: float) -> str:
    """A whole number; zero has no sign."""
    return f"{round(100 * share)}".replace("-", "−")


def quantity(value: float, unit: str) -> str:
    """A number with its unit; pure numbers have none."""
    return number(value) if unit in ("", "1") else f"{number(value)} {unit}"


def listed(names: Iterable[str], last: str = "and") -> str:
    """`a`, `a and b`, `a, b and c`."""
    each = list(names)
    return each[0] if len(each) == 1 else f"{', '.join(each[:-1])} {last} {each[-1]}"


def companions(report: GapReport) -> tuple[str, ...]:
    """Effects that this observation cannot tell from the verdict's, in the order of their probability."""
    named = report.named
    confused: Sequence[str] = () if named is None else named.confused_with
    return tuple(effect.name for effect in report.effects if effect.name in confused)


def certainty(report: GapReport) -> float:
    """Probability of the verdict, with those effects that cannot be told from it."""
    return report.verdict.probability + sum(report.finding(name).probability for name in companions(report))


def added(report: GapReport) -> str | None:
    """What the verdict adds to the twin, `wind` or `wind and plasticity`; None: nothing."""
    if report.named is None:
        return None
    names = [report.verdict.effect, report.verdict.second]
    return listed(plain(name) for name in names if name is not None)


def stacked(name: str) -> str:
    """Two effects below each other: beside each other they are wider than a figure has room for."""
    return name.replace(" and ", "\nand ")


def verb(report: GapReport, one: str, several: str) -> str:
    """The form of a verb that goes with what the verdict adds to the twin."""
    return one if report.verdict.second is None else several


def with_effect(report: GapReport) -> str:
    """What the twin is called that has the verdict's effect."""
    name = added(report)
    return "with the best effect" if name is None else f"with {name}"
