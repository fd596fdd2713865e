"""TwinBundle → another program's files: the seam every export format fills."""

from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from model.bundle import TwinBundle


class Exporter(ABC):
    """Writes a twin in one format."""

    name: ClassVar[str]
    expressed: ClassVar[frozenset[str]] = frozenset()
    """Effects of `effects.json` that the files do what the twin does with, by name."""

    @abstractmethod
    def __call__(self, twin: "TwinBundle", out: Path) -> list[Path]:
        """Write `twin` to `out` (a file or a folder, as the format has it) and say what was written.

        Raises:
            InputError: the format cannot express this twin; the message says why.
        """

    def lost(self, effect: str) -> str:
        """What an effect that is not among `expressed` means for whoever uses the files: one line."""
        return f"{self.name}: the files do not have the effect {effect}: they move as the twin without it"

    def losses(self, twin: "TwinBundle") -> tuple[str, ...]:
        """A line for each effect of the twin that the files do not have: to be told, and for a README."""
        names = dict.fromkeys(effect.name for effect in twin.effects)
        lost = tuple(self.lost(name) for name in names if name not in self.expressed)
        decay = twin.parameters.globals.get("bending_decay")
        if decay is None or not decay.value:
            return lost
        return (
            *lost,
            f"{self.name}: the files have no bending_decay: zigzags of neighbours go on for longer",
        )
