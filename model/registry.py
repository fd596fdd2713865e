"""Choosing one method of a stage by its name."""

from collections.abc import Iterable
from typing import ClassVar, Protocol, TypeVar

from model.errors import InputError


class Named(Protocol):
    """Anything that is chosen by name."""

    name: ClassVar[str]


T = TypeVar("T", bound=Named)


def by_name(methods: Iterable[type[T]], name: str, stage: str) -> type[T]:
    """Return the method called `name`.

    Raises:
        InputError: no method of this stage has that name; the message lists those there are.
    """
    found = {method.name: method for method in methods}
    if name not in found:
        raise InputError(f"unknown {stage} method {name!r}: choose one of {', '.join(sorted(found))}")
    return found[name]
