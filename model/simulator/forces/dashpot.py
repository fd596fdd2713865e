"""The dashpot along the axis."""

from collections.abc import Mapping
from typing import ClassVar

from model.simulator.forces.base import AxialForce, Scalar
from model.simulator.parameters import Constant, TensorLike


class Dashpot(AxialForce):
    r"""Viscous damper along each edge, controller springs included; a rigid motion passes undamped.

    $f_i = \gamma\,\big((v_j - v_i)\cdot\hat d\big)\,\hat d$.

    Args:
        dashpot_damping: $\gamma$ [N·s/m]; one value, or shape [spring_count + controller_spring_count].

    Reference:
        Baraff and Witkin (1998), Large steps in cloth simulation, SIGGRAPH '98 (damping forces act along the
        gradient of a condition), for the condition |d| - L.
    """

    name = "dashpot"
    where = "edges"
    internal = central = dissipative = True
    constants: ClassVar[Mapping[str, Constant]] = {
        "dashpot_damping": Constant("N*s/m", "edges", (0.0, 200.0))
    }

    def __init__(self, dashpot_damping: TensorLike) -> None:
        """See the class."""
        super().__init__(dashpot_damping=dashpot_damping)

    @staticmethod
    def law(rate: Scalar, dashpot_damping: Scalar) -> Scalar:
        """Tension [N]."""
        return dashpot_damping * rate
