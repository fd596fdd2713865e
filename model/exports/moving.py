"""The Gaussians in every frame of a motion."""

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, get_args

from model.schema import EffectName
from model.types import Gaussians, Trajectory

if TYPE_CHECKING:
    from model.bundle import TwinBundle

EVERY_EFFECT: frozenset[str] = frozenset(get_args(EffectName))
"""A motion that was rolled out here has what every effect does."""


def moving_gaussians(twin: "TwinBundle", trajectory: Trajectory) -> Iterator[Gaussians]:
    """The Gaussians of each frame; their colours stay, harmonics do not turn with them."""
    import torch

    from model.skinning import Skin

    skin = Skin(twin.gaussians, twin.topology)
    with torch.no_grad():
        for points in trajectory.points:
            means, turns = skin(torch.from_numpy(points))
            yield replace(twin.gaussians, means=means.numpy(), quaternions=turns.numpy())
