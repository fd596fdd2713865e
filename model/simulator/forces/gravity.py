"""Uniform gravity."""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Float
from torch import Tensor

from model.simulator.forces.base import ForceTerm, Scalar
from model.simulator.motion import Motion
from model.simulator.parameters import Constant, TensorLike, Values


class Gravity(ForceTerm):
    r"""The weight of every point, $f_i = m_i\,g$.

    Args:
        gravity: Acceleration g [m/s²], shape [3].

    Reference:
        Newton (1687), Philosophiae naturalis principia mathematica, book 3, proposition 6 (weight is
        proportional to mass).
    """

    name = "gravity"
    steady = True
    constants: ClassVar[Mapping[str, Constant]] = {
        "gravity": Constant("m/s^2", "vector", (-9.81, 9.81), positive=False)
    }

    def __init__(self, gravity: TensorLike = (0.0, 0.0, -9.81)) -> None:
        """See the class."""
        super().__init__(gravity=gravity)

    @staticmethod
    def law(mass: Scalar, gravity: Scalar) -> Scalar:
        """One component of the force [N] on a point."""
        return mass * gravity

    def force(self, motion: Motion, values: Values) -> Float[Tensor, "*b N 3"]:
        """Force [N] on every point."""
        force: Tensor = self.law(motion.mass, values["gravity"].unsqueeze(-2))
        return force

    def energy(self, motion: Motion, values: Values) -> Float[Tensor, "*b"]:
        """Height energy [J], zero at the origin."""
        return -(self.force(motion, values) * motion.positions).sum((-2, -1))
