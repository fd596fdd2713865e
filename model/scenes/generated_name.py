"""The name of a generated object: what of, of which world, which of its objects."""

import re
from dataclasses import dataclass

_WRITTEN = re.compile(r"(?P<kind>[a-z]+)-(?P<seed>\d+)-(?P<number>\d{4,})")


@dataclass(frozen=True)
class GeneratedName:
    """As in `plush-0-0007`; `str` writes it.

    Attributes:
        kind: Class of the object.
        seed: Of the world.
        number: Of the object in it.
    """

    kind: str
    seed: int
    number: int

    def __str__(self) -> str:
        """As files and indices have it."""
        return f"{self.kind}-{self.seed}-{self.number:04d}"

    @classmethod
    def read(cls, text: str) -> "GeneratedName | None":
        """What `str` has written; None: another name."""
        found = _WRITTEN.fullmatch(text)
        return found and cls(found["kind"], int(found["seed"]), int(found["number"]))
