"""A hand that is later, or earlier, than it is said to be."""

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import torch
from jaxtyping import Float
from torch import Tensor

from model.gap.effects.base import Effect, Field, Grid, Quantity, Values, no_grip
from model.gap.effects.grip_slip import GripSlip
from model.gap.world import World


class ActuationDelay(Effect):
    """The controllers are where they were said to be some time before."""

    name = "actuation_delay"
    source = r"""$c'(t) = c(t - \tau)$, linear between frames, held beyond the first and the last.

    Reference:
        Åström and Hägglund (2006), Advanced PID control, section 2.3 (dead time).
    """
    acts = "hand"
    quantities: ClassVar[Mapping[str, Quantity]] = {"delay": Quantity("s", (-0.4, 0.4), 0.02)}
    stacks: ClassVar[bool] = True
    absent: ClassVar[Mapping[str, float]] = {"delay": 0.0}
    grid: ClassVar[Grid] = {"delay": (-0.03, 0.03)}
    confused_with: ClassVar[Mapping[str, str]] = {
        "grip_slip": "move to and fro with reversals",
        "viscoelasticity": "move to and fro with reversals",
    }

    def unable(self, world: World) -> str | None:
        """Why it cannot act."""
        return no_grip(world)

    def apply(self, world: World, values: Values, where: Field | None = None) -> World:
        """Shift the motion of the hand in time."""
        assert world.controls is not None
        return replace(
            world, controls=_shifted(world.controls, torch.from_numpy(world.times), values["delay"])
        )

    def strength(self, world: World, values: Values, where: Field | None = None) -> Field:
        """The points that are held."""
        return GripSlip().strength(world, values)


def _shifted(
    controls: Float[Tensor, "T *b C 3"], times: Float[Tensor, " T"], delay: Tensor
) -> Float[Tensor, "T *d C 3"]:
    """Where the controllers were `delay` [s] before; scalar, or [b, 1] for b delays at once."""
    if len(times) == 1:  # a hand of which one place is known is there
        return controls
    asked = (times.to(delay) - delay).clamp(float(times[0]), float(times[-1])).movedim(-1, 0).contiguous()
    after = torch.searchsorted(times, asked.detach().to(times), right=True).clamp(1, len(times) - 1)
    begin, end = times[after - 1].to(delay), times[after].to(delay)
    share = ((asked - begin) / (end - begin)).to(controls)
    if controls.ndim == 3:
        earlier, later = controls[after - 1], controls[after]
    else:  # many worlds, each with a hand of its own
        after = after.reshape(len(times), -1).expand(-1, controls.shape[1])
        share = share.reshape(len(times), -1).expand_as(after)
        each = torch.arange(controls.shape[1])
        earlier, later = controls[after - 1, each], controls[after, each]
    return earlier + share[..., None, None] * (later - earlier)
