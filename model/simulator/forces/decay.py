"""Forces whose effect over a time step is known exactly."""

from abc import ABC, abstractmethod
from typing import ClassVar

from jaxtyping import Float
from torch import Tensor

from model.simulator.forces.base import ForceTerm, Law
from model.simulator.motion import Motion
from model.simulator.parameters import Values


class Decay(ForceTerm, ABC):
    r"""A force proportional to momentum, $f = -r\,m\,v$, which is $v \leftarrow v\,e^{-r\,dt}$.

    An integrator applies the factor after the other forces (a Lie splitting, first order) instead of adding
    the force, so that no rate, however large, makes a step unstable.
    """

    law: ClassVar[Law]
    """A static function of the constants and `dt`: the factor on the velocity."""
    dissipative = True

    @abstractmethod
    def rate(self, values: Values) -> Tensor:
        """The r [1/s] of each point."""

    def force(self, motion: Motion, values: Values) -> Float[Tensor, "*b N 3"]:
        """The force [N] that the factor integrates."""
        return -(self.rate(values).unsqueeze(-1) * motion.mass) * motion.velocities

    def factor(self, values: Values, dt: float) -> Tensor:
        """What a step of `dt` [s] multiplies each velocity with."""
        factor: Tensor = type(self).law(**values, dt=dt)
        return factor.unsqueeze(-1)
