"""What a fit looks for: parameters of a scene, their bounds, and the scale on which they are searched."""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float, Float64, Int
from torch import Tensor

from model.errors import InputError
from model.simulator.fitting.scene import Scene

SOFT = 0.1
"""Where a parameter that may be zero goes from a linear to a logarithmic scale, as a share of its start."""


@dataclass(frozen=True)
class Gaussian:
    """What is known of a parameter beforehand."""

    mean: float | Tensor
    """In the parameter's unit."""
    spread: float
    """One standard deviation: of the natural logarithm for a parameter above zero, else in its unit."""


@dataclass(frozen=True)
class Unknown:
    """A parameter to be fitted; `seek` makes one.

    The search moves on a coordinate z that is the logarithm of a parameter that must be above zero,
    log(x + soft) of one that may be zero, so that its gradient never vanishes there, and x / scale otherwise.
    """

    name: str
    """As `Scene.with_values` has it, or as the caller's own way of applying it."""
    start: Float64[Tensor, "..."]
    """In its unit: the free values, as many as are to be found."""
    bounds: tuple[float, float]
    """In its unit."""
    soft: float | None
    """In its unit; None: no logarithm."""
    scale: float
    """In its unit, where there is no logarithm: how far a first step may go."""
    share: Int[Tensor, "..."] | None = None
    """Which free value each element takes; None: as they are."""
    base: Tensor | None = None
    """What the values are factors of; None: nothing."""
    prior: Gaussian | None = None

    @property
    def size(self) -> int:
        """Free values."""
        return self.start.numel()

    def coordinates(self, values: Float[Tensor, "..."]) -> Float64[Tensor, "..."]:
        """Z of free values, in the same shape."""
        wide = values.detach().double()
        return wide / self.scale if self.soft is None else (wide + self.soft).log()

    def values(self, z: Float64[Tensor, "..."]) -> Float64[Tensor, "..."]:
        """Free values, in their unit, of coordinates."""
        return z * self.scale if self.soft is None else z.exp() - self.soft

    def apply(self, z: Float64[Tensor, "..."]) -> Float64[Tensor, "..."]:
        """What the scene takes: shared out, and times the base."""
        values = self.values(z.reshape(self.start.shape))
        if self.soft is not None:
            values = values - values.detach().clamp_max(
                0.0
            )  # rounding at the bound; a clamp would cut gradients
        if self.share is not None:
            values = values[self.share]
        return values if self.base is None else values * self.base

    def limits(self) -> tuple[float, float]:
        """The bounds of z."""
        low, high = (
            float(self.coordinates(torch.tensor(bound, dtype=torch.float64))) for bound in self.bounds
        )
        return low, high

    def slack(self, z: Float64[Tensor, "..."]) -> Float64[Tensor, "..."]:
        """How far from the prior, in standard deviations of it."""
        assert self.prior is not None
        mean = torch.as_tensor(self.prior.mean, dtype=torch.float64)
        middle = self.coordinates(mean)
        spread = self.prior.spread
        if self.soft is None:
            spread = spread / self.scale
        elif self.soft:  # a spread of the logarithm, seen on the scale of log(x + soft)
            spread = spread * float((mean / (mean + self.soft)).mean())
        return (z - middle) / spread


def seek(
    scene: Scene,
    name: str,
    *,
    start: float | Tensor | None = None,
    bounds: tuple[float, float] | None = None,
    share: Int[Tensor, "..."] | None = None,
    relative: bool = False,
    prior: Gaussian | None = None,
    scale: float | None = None,
) -> Unknown:
    """An unknown of a scene, with what the scene knows of it filled in.

    Args:
        scene: What is fitted.
        name: `spring.stiffness`, …; see `Scene.with_values`.
        start: Where to begin, in the parameter's unit, one number or as many as are free; None: the value
            that the scene has (per element), or its geometric or arithmetic mean where values are shared.
        bounds: In the parameter's unit; None: what its constant declares as plausible.
        share: For each element which free value it takes: zeros for one value for all, part labels for one
            per part; None: the values are free as they start.
        relative: The free values are factors of what the scene has now; `bounds` and `start` then are, too
            (0.01 to 100 and 1 by default).
        prior: A Gaussian on the free values.
        scale: How far a first step may go, in the parameter's unit; only for those without logarithm.

    Raises:
        InputError: bounds or a start that cannot be; says which.
    """
    constant = scene.constant(name)
    positive = constant.positive or relative
    low, high = bounds or ((0.01, 100.0) if relative else constant.range)
    if not (low < high and math.isfinite(low) and math.isfinite(high) and (low >= 0 or not positive)):
        raise InputError(f"bounds of {name} are {low} … {high}: give two finite numbers, the lower first")
    count = 1 if share is None else int(share.max()) + 1
    if start is None:
        current = torch.ones(()) if relative else scene.value(name).detach()
        begin = current.double() if share is None else _means(current.double(), share, positive)
    else:
        begin = torch.as_tensor(start, dtype=torch.float64).detach()
    if share is not None:
        begin = begin.reshape(-1).expand(count) if begin.numel() == 1 else begin
        if len(begin) != count:
            raise InputError(f"{name} starts from {len(begin)} values, but {count} are shared out")
    if not bool(torch.isfinite(begin).all()):
        raise InputError(f"{name} starts from a value that is not finite")
    begin = begin.clamp(low, high).clone()
    base = scene.value(name).detach().double() if relative else None
    if scale is None:
        scale = max(float(begin.abs().max()), (high - low) / 10)
    return Unknown(name, begin, (low, high), _soft(begin, low, high, positive), scale, share, base, prior)


def _soft(start: Tensor, low: float, high: float, positive: bool) -> float | None:
    if not positive:
        return None
    if low > 0:
        return 0.0
    typical = float(start.mean())
    return SOFT * typical if typical > 0 else 0.01 * high


def _means(values: Tensor, share: Tensor, positive: bool) -> Tensor:
    """The mean of those that share a value."""
    count = int(share.max()) + 1
    each = values.expand(share.shape).reshape(-1)
    positive = positive and bool((each > 0).all())
    each = each.log() if positive else each
    total = torch.zeros(count, dtype=torch.float64).index_add(0, share.reshape(-1), each)
    mean = total / torch.bincount(share.reshape(-1), minlength=count).clamp_min(1)
    return mean.exp() if positive else mean
