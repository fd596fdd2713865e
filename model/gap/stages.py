"""Who is told how far a diagnosis has come."""

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[str, float], None]
"""Told the stage, and what share of the whole is done."""
Portion: TypeAlias = Callable[[float], None]
"""Told what share of a part of it is done."""


def within(tell: Progress, stage: str, begin: float, end: float) -> Portion:
    """Tells the share of a part of a stage, which goes from `begin` to `end` of the whole."""
    return lambda share: tell(stage, begin + (end - begin) * share if share < 1.0 else end)
