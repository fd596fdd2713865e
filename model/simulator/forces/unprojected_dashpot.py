"""The dashpot as the paper prints it."""

from collections.abc import Mapping
from typing import ClassVar

from jaxtyping import Float
from torch import Tensor

from model.simulator.forces.base import PairForce, Scalar
from model.simulator.motion import Motion
from model.simulator.parameters import Constant, TensorLike, Values


class UnprojectedDashpot(PairForce):
    r"""Viscous damper on the whole relative velocity of an edge's ends; it damps rigid rotation too.

    $f_i = -\gamma\,(v_i - v_j)$. Printed in the paper, while its code projects on the axis: `Dashpot` is the
    default. It exerts a net torque.

    Args:
        dashpot_damping: $\gamma$ [N·s/m]; one value, or shape [spring_count + controller_spring_count].

    Reference:
        Jiang et al. (2025), PhysTwin: Physics-informed reconstruction and simulation of deformable objects
        from videos, arXiv:2503.17973 (the dashpot force of the spring-mass model).
    """

    name = "unprojected_dashpot"
    where = "edges"
    internal = dissipative = True
    constants: ClassVar[Mapping[str, Constant]] = {
        "dashpot_damping": Constant("N*s/m", "edges", (0.0, 200.0))
    }

    def __init__(self, dashpot_damping: TensorLike) -> None:
        """See the class."""
        super().__init__(dashpot_damping=dashpot_damping)

    @staticmethod
    def law(relative_velocity: Scalar, dashpot_damping: Scalar) -> Scalar:
        """One component of the force [N] from that of the relative velocity [m/s]."""
        return dashpot_damping * relative_velocity

    def edge_force(self, motion: Motion, values: Values) -> Float[Tensor, "*b e 3"]:
        """Force [N] on the first end of each edge."""
        force: Tensor = self.law(motion.relative_velocity, values["dashpot_damping"].unsqueeze(-1))
        return force
