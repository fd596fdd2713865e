"""What a body is taken for before any fit: masses, patterns of stiffness, lengths at rest, how it is held."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from model.gap.bodies.body import Body
from model.gap.bodies.hold import Hold
from model.gap.wrinkling import SLACKNESS
from model.simulator.structure import rows
from model.types import Array, Observation

MASS = 0.2
"""Of the body [kg]. Without forces measured, motion tells ratios to mass alone."""
LOOSEST = 1e-9
"""No point within a hand is held by less than this share of what the nearest one is: what bears its share of
the weight must give way by a finite length."""
ONE_HAND = 2.5
"""Grasps: controllers nearer than this belong to one hand."""
LIMP = 0.1
"""`bending` of a sheet where a fit begins: 1 is thin cotton's, 0.003 silk's."""
SUPPLE = 8.0
"""`bending` of a rope of which it is seen how thick it is: it bends under its own weight over twice that."""
CALM = {"rope": 1000.0, "sheet": 400.0, "solid": 0.0}
"""Of a body of which nothing is known, `bending_decay` [1/s]; of a sheet where a fit of it begins.

Rows of points that are pressed together buckle into zigzags, which nothing else resists: without it twins
that are equal but for a rounding, 1e-7 m, are centimetres apart within a second, however closely an observer
leads them; with it they stay as near. Waves of a fifth of a rope's length die out at 4 /s, of half of it at
0.1 /s, less than air takes.
"""


@dataclass(frozen=True)
class Matter:
    """What a body is taken for before any fit; a fit moves the numbers that belong to all of it."""

    mass: Float64[Array, " P"]
    """[kg]."""
    pattern: Float64[Array, " E"]
    """Stiffness of each spring over the `stiffness` of the twin."""
    length: Float64[Array, " E"]
    """Rest length of each spring without prestress [m]."""
    grip_pattern: Float64[Array, " S"]
    """Stiffness of each spring of the hand over `grip` times `stiffness`, where the hand reaches it."""
    grip_length: Float64[Array, " S"]
    """[m]."""
    start: Mapping[str, float]
    """Where a fit of `PlainTwin.quantities` starts."""
    given: bool
    """It came with the twin; else nothing is known of the body but its shape."""
    hold: Hold | None = None
    """The points within a hand, where it is not known which of them it holds; None: it is."""
    restitution: float = 0.0
    collision_distance: float = 0.0
    """[m]; 0: the body does not meet itself."""
    bending_decay: float = 0.0
    """Rate at which zigzags between neighbouring points die out [1/s]; of cloth where a fit of it begins."""
    slackness: float = 0.0
    """Of cloth, share of the compression that it wrinkles under instead of bearing it; 0: it is none."""

    def fading(self, reach: Tensor, moved: Float[Tensor, "*b n 3"] | None = None) -> Float[Tensor, "*b S"]:
        """How firmly a hand that reaches so far [m] holds each point, 0..1: fully where it is.

        Args:
            reach: Where the firmness has fallen to 0.6 [m].
            moved: How far each hand is from its controllers on the body [m]; None: it is where they are.
        """
        if self.hold is None:
            return torch.ones(len(self.grip_pattern), dtype=torch.float64)
        firm: Tensor = torch.exp(-0.5 * self.hold.square(moved) / reach**2)
        return firm.clamp_min(LOOSEST)

    @classmethod
    def guessed(cls, body: Body, observation: Observation) -> "Matter":
        """Of a body of which nothing is known but its shape, which is at ease but for its weight."""
        way = body.points[body.springs[:, 1]] - body.points[body.springs[:, 0]]
        length: Float64[Array, " E"] = np.linalg.norm(way, axis=1)
        hands = observation.controllers[0].astype(np.float64)
        hold = Hold.of(hands, body.points[body.grip[:, 1]], ONE_HAND * body.grasp)
        weight = MASS * max(float(np.linalg.norm(observation.gravity)), 1.0)
        start = {
            "stiffness": 30.0 * weight / body.spacing / max(1.0, len(body.points) ** 0.5),
            "damping": 0.05,
            "drag_rate": 0.3,
            "prestress": 0.8,
            "grip": 3.0,
            "reach": 0.6,
            "friction": 0.5,
            "bending": LIMP if body.aside is None else SUPPLE,
            "memory_of_shape": 0.5,
        }
        return cls(
            MASS * body.share,
            body.spacing / length,
            length,
            np.ones(len(body.grip)),
            np.zeros(len(body.grip)),
            start,
            given=False,
            hold=hold,
            # few points, or several in one place, may have no three in a row
            bending_decay=CALM[body.shape] if len(rows(body.points, body.springs)) else 0.0,
            slackness=SLACKNESS if body.shape == "sheet" else 0.0,
        )
