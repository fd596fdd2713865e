"""Shapes of the arrays of one file, checked against each other."""

from typing import TypeAlias

from model.errors import InputError

Shape: TypeAlias = tuple[str | int, ...]
"""Sides; a letter is one number throughout a file."""


def check_shape(name: str, found: tuple[int, ...], shape: Shape, sizes: dict[str, int], where: str) -> None:
    """Refuse an array of another shape; what its letters turn out to be is added to `sizes`.

    Args:
        name: Of the array.
        found: Its shape.
        shape: The one that it should have.
        sizes: Numbers that letters stand for already.
        where: The file, for the message.

    Raises:
        InputError: says what was expected, as far as that is known, and found.
    """
    wanted = tuple(sizes.get(side, side) if isinstance(side, str) else side for side in shape)
    if len(found) != len(wanted) or any(
        want != have for want, have in zip(wanted, found, strict=True) if isinstance(want, int)
    ):
        raise InputError(f"{where}: {name}: expected shape {_say(wanted)}, found {_say(found)}")
    sizes |= {side: have for side, have in zip(shape, found, strict=True) if isinstance(side, str)}


def _say(shape: Shape) -> str:
    return "[" + ", ".join(str(side) for side in shape) + "]"
