"""The little bending stiffness that every cloth and rope has."""

import torch
from torch import Tensor

from model.gap.bodies.body import Body
from model.gap.size import size_of
from model.simulator.forces.bending import Bending
from model.simulator.forces.curved_bending import CurvedBending
from model.simulator.structure import rows, spans, turns

SLIGHT = {"rope": 2e-6, "sheet": 7e-4}
"""Of a rope over weight times length squared, of a sheet over weight times length times spacing: as of thin
cotton, which 1 to 5 % of its length bend under their own weight."""
SLIGHT_THICK = 1.0
"""Of a rope of which it is seen how thick it is, over weight per length times the cube of that: a soft one
bends under its own weight over a length that it is thick."""
RUBBER = 500.0
"""Modulus over density [m²/s²] of soft rubber: no usual rope resists bending more than a full one of it."""


class SlightBending(Bending):
    """Keeps folds larger than the spacing of the points.

    Without any resistance to bending a cloth or a rope crumples at random: twins that differ by nothing but
    where their points are then move apart within a second.
    """

    name = "slight_bending"


class SlightCurvedBending(CurvedBending):
    """The same of a rope, which is as long as its folds are and knows in which direction it is curved."""

    name = SlightBending.name


def slight_bending(
    body: Body, weight: float, share: Tensor | float = 1.0, memory: Tensor | float = 1.0
) -> SlightBending | SlightCurvedBending | None:
    """For a body at ease between straight and as it is first seen; None where it has no rows of points.

    Args:
        body: A rope or a sheet.
        weight: [N].
        share: Of what is usual [1], a scalar or of shape [*b, 1].
        memory: Of its first shape [1], the same: 0 is straight.
    """
    if body.shape == "solid":
        return None
    triples = rows(body.points, body.springs)
    if not len(triples):
        return None
    kind = SlightCurvedBending if body.shape == "rope" else SlightBending
    return kind(
        torch.from_numpy(triples),
        bending_stiffness=_usual(body, weight, share) * torch.ones(len(triples)),
        span=spans(body.points, triples),
        rest_turn=memory * torch.from_numpy(turns(body.points, triples)),
    )


def stiffest_share(body: Body, gravity: float) -> float:
    """Times what is usual that a full rope of soft rubber has, as thick as it is.

    Of a full rod of modulus E and density ρ, as thick as d, B = E π d⁴ / 64 and its weight per length is
    ρ g π d² / 4: B is E / (16 ρ g d) times weight per length times d³.

    Args:
        body: A rope of which it is seen how thick it is.
        gravity: [m/s²].
    """
    assert body.aside is not None
    return RUBBER / (16.0 * max(gravity, 1.0) * 2.0 * body.aside.radius * SLIGHT_THICK)


def _usual(body: Body, weight: float, share: Tensor | float) -> Tensor | float:
    """That share of what a thin rope or sheet has, or a rope as thick as it is [N·m²]."""
    length = size_of(body.points)
    if body.aside is not None:
        return share * SLIGHT_THICK * weight / length * (2.0 * body.aside.radius) ** 3
    return share * SLIGHT[body.shape] * weight * length * (length if body.shape == "rope" else body.spacing)
