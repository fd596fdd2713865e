"""What numbers of a training have to be."""

import math

from torch import Tensor, isfinite

from model.errors import InputError


def at_least(least: int, where: str, **options: int | float) -> None:
    """Refuse options below this, and what is no number.

    Args:
        least: That each may be.
        where: What they are options of, as on the command line.
        options: By name.

    Raises:
        InputError: the first that is less, infinite or NaN.
    """
    for name, value in options.items():
        if not (value >= least and math.isfinite(value)):
            raise InputError(f"{where}.{name} is {value}: expected {least} or more")


def finite(values: Tensor) -> bool:
    """Whether nothing among them is NaN or infinite."""
    return bool(isfinite(values).all())
