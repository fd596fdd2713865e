"""Springs to points that move as they are told."""

from collections.abc import Mapping
from typing import ClassVar

from model.simulator.forces.base import AxialForce
from model.simulator.forces.spring import Spring
from model.simulator.parameters import Constant, TensorLike


class ControllerSpring(AxialForce):
    r"""Linear springs from points to controllers, whose motion is given.

    The law of `Spring`, with $x_j$ the controller. A dashpot acts on the same edges (`Dashpot`), and sees the
    velocity of the controller's motion.

    Args:
        stiffness: Spring stiffness k [N/m], shape [controller_spring_count].

    Reference:
        Jiang et al. (2025), PhysTwin: Physics-informed reconstruction and simulation of deformable objects
        from videos, arXiv:2503.17973 (control points are joined to the object by springs).
    """

    name = "controller_spring"
    where = "controllers"
    constants: ClassVar[Mapping[str, Constant]] = {"stiffness": Constant("N/m", "controllers", (1.0, 1e5))}
    law = Spring.law
    potential = Spring.potential

    def __init__(self, stiffness: TensorLike) -> None:
        """See the class."""
        super().__init__(stiffness=stiffness)
