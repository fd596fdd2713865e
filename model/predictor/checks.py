"""What options of a training have to be."""

from model.errors import InputError


def at_least(least: int, where: str, **options: int | float) -> None:
    """Refuse options below this.

    Args:
        least: That each may be.
        where: What they are options of, as on the command line.
        options: By name.

    Raises:
        InputError: the first that is less.
    """
    for name, value in options.items():
        if value < least:
            raise InputError(f"{where}.{name} is {value}: expected {least} or more")
