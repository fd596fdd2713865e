"""The ground plane."""

from collections.abc import Mapping
from typing import ClassVar

import torch
from jaxtyping import Float
from torch import Tensor

from model.simulator.contacts.base import ContactTerm
from model.simulator.contacts.coulomb import coulomb
from model.simulator.parameters import Constant, TensorLike, Values

SLOWEST = 1e-12
"""Slip [m/s] below which there is nothing to rub away."""


class Ground(ContactTerm):
    r"""A plane z = h with restitution and Coulomb friction.

    A point that moves down and would be below the plane after the step gets $v_n' = -e\,v_n$ and
    $v_t' = v_t\,\max(0, 1 - \mu(1+e)|v_n|/|v_t|)$. So no point crosses the plane, and one that starts
    below it sinks no further.

    Args:
        restitution: e [1].
        friction: $\mu$ [1].
        height: h [m].

    Reference:
        Bridson, Fedkiw and Anderson (2002), Robust treatment of collisions, contact and friction for cloth
        animation, SIGGRAPH '02 (the friction impulse).
    """

    name = "ground"
    constants: ClassVar[Mapping[str, Constant]] = {
        "restitution": Constant("1", "points", (0.0, 1.0)),
        "friction": Constant("1", "points", (0.0, 2.0)),
        "height": Constant("m", "points", (-1.0, 1.0), positive=False),
    }

    def __init__(self, restitution: TensorLike, friction: TensorLike, height: TensorLike = 0.0) -> None:
        """See the class."""
        super().__init__(restitution=restitution, friction=friction, height=height)

    def resolve(
        self,
        positions: Float[Tensor, "*b N 3"],
        velocities: Float[Tensor, "*b N 3"],
        mass: Float[Tensor, "*m N 1"],
        dt: float,
        values: Values,
    ) -> Float[Tensor, "*b N 3"]:
        """Velocities [m/s] after the contacts of a step of `dt` [s]."""
        vertical = velocities[..., 2]
        with torch.no_grad():
            meets = (positions[..., 2] + dt * vertical < values["height"]) & (vertical < 0)
            if not bool(meets.any()):
                return velocities
        approach = torch.where(meets, -vertical, 0.0)
        tangential = velocities[..., :2]
        slip = torch.linalg.vector_norm(tangential, dim=-1).clamp_min(SLOWEST)
        rebound, kept = coulomb(approach, slip, values["restitution"], values["friction"])
        after = torch.cat([tangential * kept.unsqueeze(-1), rebound.unsqueeze(-1)], -1)
        return torch.where(meets.unsqueeze(-1), after, velocities)
