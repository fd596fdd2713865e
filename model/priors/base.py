"""What a part is made of: the seam every material expert fills."""

from typing import ClassVar, Protocol, runtime_checkable

from model.types import MaterialPrior, PartView


@runtime_checkable
class PriorClient(Protocol):
    """Looks at a part and says what it believes about its material."""

    name: ClassVar[str]
    version: ClassVar[str]
    weights: str | None

    def material(self, part: PartView) -> MaterialPrior:
        """Believe something about one part (or, with the label `object`, about the whole)."""
        ...
