"""TwinBundle → another program's files: the seam every export format fills."""

from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from model.formats.parameters import scalar

if TYPE_CHECKING:
    from model.bundle import TwinBundle


class Exporter(ABC):
    """Writes a twin in one format."""

    name: ClassVar[str]
    expressed: ClassVar[frozenset[str]] = frozenset()
    """Effects of `effects.json` that the files do what the twin does with, by name."""
    simulated: ClassVar[bool] = True
    """Whether programs move the files by laws of their own; else they show the twin's motion, or none."""

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
        """A line for each thing of the twin that the files do not have: to be told, and for a README."""
        names = dict.fromkeys(effect.name for effect in twin.effects)
        lost = [self.lost(name) for name in names if name not in self.expressed]
        if self.simulated and scalar(twin.parameters, "collision_distance", 0.0):
            lost.append(
                f"{self.name}: the files have no self-contact: points of the object pass through each other"
            )
        if self.simulated and scalar(twin.parameters, "bending_decay", 0.0):
            lost.append(
                f"{self.name}: the files have no bending_decay: zigzags of neighbours go on for longer"
            )
        return tuple(lost)
