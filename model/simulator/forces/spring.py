"""The linear spring."""

from collections.abc import Mapping
from typing import ClassVar

from model.simulator.forces.base import AxialForce, Scalar
from model.simulator.parameters import Constant, TensorLike


class Spring(AxialForce):
    r"""Linear spring along each edge.

    $f_i = k\,(\lVert d\rVert - L)\,\hat d$, with $d = x_j - x_i$.

    Args:
        stiffness: Spring stiffness k [N/m], shape [spring_count].

    Reference:
        Provot (1995), Deformation constraints in a mass-spring model to describe rigid cloth behavior,
        Graphics Interface '95 (the internal force: the sum of the tensions of the linked springs).
    """

    name = "spring"
    internal = central = True
    constants: ClassVar[Mapping[str, Constant]] = {"stiffness": Constant("N/m", "springs", (1.0, 1e5))}

    def __init__(self, stiffness: TensorLike) -> None:
        """See the class."""
        super().__init__(stiffness=stiffness)

    @staticmethod
    def law(length: Scalar, rest_length: Scalar, stiffness: Scalar) -> Scalar:
        """Tension [N]."""
        return stiffness * (length - rest_length)

    @staticmethod
    def potential(length: Scalar, rest_length: Scalar, stiffness: Scalar) -> Scalar:
        """Energy [J]."""
        return 0.5 * stiffness * (length - rest_length) ** 2
