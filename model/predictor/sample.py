"""What the network reads of one case or of several joined ones, and what it answers."""

from dataclasses import dataclass, fields, replace

import torch
from jaxtyping import Float, Int64
from torch import Tensor

GLOBALS = ("dashpot_damping", "drag_rate", "friction", "restitution")
"""Order of the last axis of `global_*`. Coordinates: ln, ln, ln, logit."""


@dataclass(frozen=True)
class Sample:
    """What the network reads.

    A sample holds B ≥ 1 cases: `make_sample` makes it of one, `join_samples` lays several behind each other
    with shifted indices. P mass points, E springs, K parts, S controller springs are those of all cases.
    Nothing here changes with a shift, a turn about the vertical or (up to its own order) the order of points.
    """

    edges: Int64[Tensor, "E 2"]
    """Mass points that each spring joins."""
    edge_part: Int64[Tensor, "E 2"]
    """Parts of its two ends; equal for inner springs."""
    edge_features: Float[Tensor, "E Fe"]
    point_part: Int64[Tensor, " P"]
    part_scene: Int64[Tensor, " K"]
    """Which of the B cases a part belongs to."""
    motion: Float[Tensor, "P D"]
    motion_global: Float[Tensor, "B Dg"]
    distribution: Float[Tensor, "K M"]
    """Prior over the ten materials."""
    prior_log_modulus: Float[Tensor, " K"]
    """ln of the prior's mean modulus [Pa]."""
    prior_log_spread: Float[Tensor, " K"]
    """Standard deviation of ln modulus, as the prior says."""
    part_share: Float[Tensor, " K"]
    """Of the volume of its case, by the prior's densities; sums to 1 per case."""
    part_features: Float[Tensor, "K Fp"]
    scene_features: Float[Tensor, "B Fs"]
    log_unit_stiffness: Float[Tensor, " E"]
    """ln of the stiffness [N/m] of each spring in a body of 1 Pa."""
    grips: Int64[Tensor, " S"]
    """The held mass point."""
    grip_features: Float[Tensor, "S Fg"]
    log_grip_anchor: Float[Tensor, " S"]
    """ln of the controller stiffness [N/m] that goes with the prior's mean moduli."""
    global_anchor: Float[Tensor, "B 4"]
    """Of `GLOBALS`, what the prior's means imply before any limit to affordable substeps."""
    global_spread: Float[Tensor, "B 4"]
    """Standard deviations of the same coordinates, as the prior says."""

    @property
    def case_count(self) -> int:
        """B."""
        return len(self.scene_features)

    def to(self, target: torch.device | torch.dtype | str) -> "Sample":
        """Move to a device, or take another floating-point type; indices stay integers."""
        if isinstance(target, torch.dtype):
            changed = {name: value.to(target) for name, value in self.tensors() if value.is_floating_point()}
        else:
            changed = {name: value.to(target) for name, value in self.tensors()}
        return replace(self, **changed)

    def tensors(self) -> list[tuple[str, Tensor]]:
        """Every field by name."""
        return [(field.name, getattr(self, field.name)) for field in fields(self)]


@dataclass(frozen=True)
class Prediction:
    """Means and spreads. Every spread is a standard deviation (positive, not its logarithm)."""

    log_modulus: Float[Tensor, " E"]
    """ln of the modulus [Pa] that each spring stands for; its stiffness is e^(log_unit_stiffness + this)."""
    log_modulus_spread: Float[Tensor, " E"]
    """Of ln modulus."""
    part_log_modulus: Float[Tensor, " K"]
    """Mean of `log_modulus` over the part's inner springs: what is supervised and calibrated."""
    part_log_spread: Float[Tensor, " K"]
    """Of ln modulus of the part."""
    log_controller_stiffness: Float[Tensor, " S"]
    """ln of N/m."""
    global_mean: Float[Tensor, "B 4"]
    """Of `GLOBALS`: ln N·s/m, ln 1/s, ln, logit."""
    global_log_spread: Float[Tensor, "B 4"]
    """Of the same coordinates: of ln for the first three, of the logit for the last."""
