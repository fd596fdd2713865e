"""The second stage of fits in PhysTwin's manner: springs by gradients of rollouts."""

from collections.abc import Callable, Sequence

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from model.evaluation.baselines.gradient import Free, descend
from model.evaluation.baselines.mechanics import Mechanics, from_coordinates, moved, to_coordinates
from model.evaluation.baselines.seen import Seen
from model.scenes.case import Case

SOFTEST = float(np.log(1e-2))
"""A spring may become so much softer than the first stage made it, in ln."""


def refine(
    case: Case,
    seen: Seen,
    begin: Mechanics,
    factors: Callable[[], Float[Tensor, " E"]],
    free: Sequence[Free],
    *,
    rate: float,
    steps: int,
) -> Mechanics:
    """Fit springs, and along with them every controller spring and the global parameters.

    Args:
        case: What is fitted.
        seen: Its frames that may be learned from.
        begin: Where the first stage ended.
        factors: Of each spring, what its stiffness is multiplied by, in ln, as what is `free` makes it.
        free: What the factors depend on.
        rate: Of a step of Adam, of controller springs and globals, in ln.
        steps: Gradients.

    Raises:
        SimulationDiverged: nothing is finite where the fit begins.
    """
    grips = torch.zeros(len(begin.grip), requires_grad=True)
    z = to_coordinates(begin.globals).requires_grad_()
    stiffness, grip = torch.as_tensor(begin.stiffness), torch.as_tensor(begin.grip)

    def loss() -> Tensor:
        made = moved(
            case,
            begin.topology,
            stiffness * factors().exp(),
            grip * grips.exp(),
            from_coordinates(z),
            len(seen),
        )
        return seen.loss(made)

    descend(loss, [*free, Free([grips], rate, SOFTEST, room(begin)), Free([z], rate)], steps)
    with torch.no_grad():
        return Mechanics(
            begin.topology,
            (stiffness * factors().exp()).numpy(),
            (grip * grips.exp()).numpy(),
            {name: float(value) for name, value in from_coordinates(z).items()},
        ).limited()


def room(mechanics: Mechanics) -> float:
    """How much stiffer every spring may become at once within `SUBSTEPS`, in ln, at most as it may soften.

    The fastest mode only rises with any spring, so that single springs within it need no more either.
    """
    return float(min(np.log(mechanics.stiffer()), -SOFTEST))
