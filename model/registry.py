"""Choosing one method of a stage by its name."""

from collections.abc import Iterable
from typing import Protocol, TypeVar, runtime_checkable

from model.errors import InputError


@runtime_checkable
class Named(Protocol):
    """Anything that is chosen by name: here, the classes of a stage's methods themselves."""

    name: str


T = TypeVar("T", bound=Named)


def by_name(methods: Iterable[T], name: str, stage: str) -> T:
    """Return the method called `name`.

    Raises:
        InputError: no method of this stage has that name; the message lists those there are.
    """
    found = {method.name: method for method in methods}
    if name not in found:
        raise InputError(f"unknown {stage} method {name!r}: choose one of {', '.join(sorted(found))}")
    return found[name]
