"""Cloth wrinkles between the points of its twin instead of bearing compression."""

import torch

from model.gap.effects.base import spring_stiffness
from model.gap.effects.tension_only import SlackSpring
from model.gap.world import World

SLACKNESS = 0.95
"""Share of the compression that cloth gives way to, in wrinkles finer than the points of a twin."""


class Wrinkling(SlackSpring):
    """Springs of a cloth that is pressed together go slack.

    The net of a twin can fold along its springs alone: were they as stiff against compression as against
    tension, it could hardly drape, and a fit would make up for that by a cloth that stretches like rubber.
    """

    name = "wrinkling"


def wrinkling(world: World, slackness: float) -> Wrinkling:
    """For all springs of a world.

    Args:
        world: Of the twin.
        slackness: Share of the compression that its springs do not bear.
    """
    stiffness = spring_stiffness(world)
    return Wrinkling(stiffness, torch.ones(stiffness.shape[-1], dtype=stiffness.dtype), slackness)
