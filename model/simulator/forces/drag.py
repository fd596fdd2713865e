"""Linear drag."""

from collections.abc import Mapping
from typing import ClassVar

import torch
from torch import Tensor

from model.simulator.forces.base import Scalar
from model.simulator.forces.decay import Decay
from model.simulator.parameters import Constant, TensorLike, Values


class Drag(Decay):
    r"""Drag proportional to momentum: velocities shrink by $e^{-\delta\,dt}$ in every step.

    Args:
        drag_rate: $\delta$ [1/s]; one value, or shape [point_count].

    Reference:
        Jiang et al. (2025), PhysTwin: Physics-informed reconstruction and simulation of deformable objects
        from videos, arXiv:2503.17973 (the drag factor of the velocity update), in exponential form.
    """

    name = "drag"
    constants: ClassVar[Mapping[str, Constant]] = {"drag_rate": Constant("1/s", "points", (0.0, 20.0))}

    def __init__(self, drag_rate: TensorLike) -> None:
        """See the class."""
        super().__init__(drag_rate=drag_rate)

    @staticmethod
    def law(drag_rate: Scalar, dt: Scalar) -> Scalar:
        """Factor on the velocity."""
        return torch.exp(-drag_rate * dt)

    def rate(self, values: Values) -> Tensor:
        """[1/s]."""
        return values["drag_rate"]
