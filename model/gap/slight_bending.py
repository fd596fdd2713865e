"""The little bending stiffness that every cloth and rope has."""

import torch
from torch import Tensor

from model.gap.bodies.body import Body
from model.gap.size import size_of
from model.simulator.forces.bending import Bending
from model.simulator.structure import rows, spans, turns

SLIGHT = {"rope": 2e-6, "sheet": 7e-4}
"""Of a rope over weight times length squared, of a sheet over weight times length times spacing: as of thin
cotton, which 1 to 5 % of its length bend under their own weight."""
SLIGHT_THICK = 1.0
"""Of a rope of which it is seen how thick it is, over weight per length times the cube of that: a soft one
bends under its own weight over a length that it is thick."""


class SlightBending(Bending):
    """Keeps folds larger than the spacing of the points.

    Without any resistance to bending a cloth or a rope crumples at random: twins that differ by nothing but
    where their points are then move apart within a second.
    """

    name = "slight_bending"


def slight_bending(body: Body, weight: float, share: Tensor | float = 1.0) -> SlightBending | None:
    """For a body at ease as it is first seen; None where it has no rows of points.

    Args:
        body: A rope or a sheet.
        weight: [N].
        share: Of what is usual [1], a scalar or of shape [*b, 1].
    """
    if body.shape == "solid":
        return None
    triples = rows(body.points, body.springs)
    if not len(triples):
        return None
    return SlightBending(
        torch.from_numpy(triples),
        bending_stiffness=_usual(body, weight, share) * torch.ones(len(triples)),
        span=spans(body.points, triples),
        rest_turn=torch.from_numpy(turns(body.points, triples)),
    )


def _usual(body: Body, weight: float, share: Tensor | float) -> Tensor | float:
    """That share of what a thin rope or sheet has, or a rope as thick as it is [N·m²]."""
    length = size_of(body.points)
    if body.aside is not None:
        return share * SLIGHT_THICK * weight / length * (2.0 * body.aside.radius) ** 3
    return share * SLIGHT[body.shape] * weight * length * (length if body.shape == "rope" else body.spacing)
