"""A contact term: impulses that change velocities when points meet something."""

from abc import ABC, abstractmethod
from typing import ClassVar

from jaxtyping import Float
from torch import Tensor

from model.simulator.parameters import Parametric, Values


class ContactTerm(Parametric, ABC):
    """A law of impact and friction at velocity level, and where it acts."""

    name: ClassVar[str]
    internal: ClassVar[bool] = False
    """The impulses sum to zero."""

    @abstractmethod
    def resolve(
        self,
        positions: Float[Tensor, "*b N 3"],
        velocities: Float[Tensor, "*b N 3"],
        mass: Float[Tensor, "*m N 1"],
        dt: float,
        values: Values,
    ) -> Float[Tensor, "*b N 3"]:
        """Velocities [m/s] after the contacts of a step of `dt` [s].

        Args:
            positions: Where the points are before they move on [m].
            velocities: With which they would move [m/s].
            mass: [kg].
            dt: Step [s].
            values: The constants as `Parametric.values` gives them.
        """
