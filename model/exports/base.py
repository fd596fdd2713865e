"""TwinBundle → another program's files: the seam every export format fills."""

from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from model.bundle import TwinBundle


class Exporter(ABC):
    """Writes a twin in one format."""

    name: ClassVar[str]

    @abstractmethod
    def __call__(self, twin: "TwinBundle", out: Path) -> list[Path]:
        """Write `twin` to `out` (a file or a folder, as the format has it) and say what was written.

        Raises:
            InputError: the format cannot express this twin; the message says why.
        """
