"""Springs that harden the more they are strained."""

from collections.abc import Mapping
from typing import ClassVar

from model.simulator.forces.base import AxialForce, Scalar
from model.simulator.parameters import Constant, TensorLike


class HardeningSpring(AxialForce):
    r"""Spring that pulls as $f = k\,(\ell - L)\,(1 + |\ell/L - 1|)^{1/2}$, in the place of the linear one.

    Args:
        stiffness: k at rest length [N/m], shape [spring_count].

    Reference:
        Zhong, Yu, Wu and Li (2024), Reconstruction and simulation of elastic objects with spring-mass 3D
        Gaussians, ECCV, arXiv:2403.09434, and its public code (power 1/2).
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
        return stiffness * (length - rest_length) * (1.0 + abs(length / rest_length - 1.0)) ** 0.5
