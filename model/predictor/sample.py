"""What the network reads of one case or of several joined ones, and what it answers."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import torch
from jaxtyping import Float, Float64, Int64, Integer
from torch import Tensor

from model.errors import InputError
from model.predictor.beliefs import describe_beliefs, log_means
from model.predictor.geometry import Geometry, describe_geometry
from model.predictor.lattice import between
from model.predictor.motion_features import MotionFeatures
from model.predictor.prior_means import dashpot_damping, grip_stiffness, pooled, volumes
from model.types import Array, MaterialPrior, ShapeClass, Topology

GLOBALS = ("dashpot_damping", "drag_rate", "friction", "restitution")
"""Order of the last axis of `global_*`. Coordinates: ln, ln, ln, logit."""
LEAST = 1e-6
"""Least stiffness of a spring over the median in a body of one modulus, so that its logarithm is finite."""
MOST = 80.0
"""Logarithms that are as far from 0 stand for nothing that numbers of single precision hold."""


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

    @property
    def lost(self) -> list[str]:
        """Names of what is NaN or beyond `MOST`, as where the training has diverged."""
        return [
            field.name for field in fields(self) if not bool((getattr(self, field.name).abs() < MOST).all())
        ]


def make_sample(
    topology: Topology,
    priors: Sequence[MaterialPrior],
    shape_class: ShapeClass,
    gravity: tuple[float, float, float],
    ground_height: float | None,
    motion: MotionFeatures,
    *,
    geometry: Geometry | None = None,
) -> Sample:
    """Gather what the network reads of one case.

    Args:
        topology: What to parametrise.
        priors: One per part, in the order of the labels.
        shape_class: Sheet, rope or solid.
        gravity: [m/s²].
        ground_height: z of the ground [m]; None: no ground.
        motion: Of this topology's mass points.
        geometry: `describe_geometry` of the same topology, where priors change and the topology stays;
            None: measured here.

    Raises:
        InputError: motion of another number of mass points, or a part without a prior.
    """
    points, parts = len(topology.points), int(topology.part.max()) + 1
    if len(motion.points) != points:
        raise InputError(
            f"sample: {points} mass points, but motion of {len(motion.points)}; describe it anew"
        )
    if len(priors) < parts:
        raise InputError(f"sample: {parts} parts, but {len(priors)} material priors; give one each")
    shape = geometry or describe_geometry(topology, len(priors), shape_class, ground_height)
    volume = volumes(topology, priors)
    ends = topology.part[topology.springs]
    log_modulus = log_means(priors, ("stiffness",))[:, 0]
    unit = (shape.shares * volume[ends]).sum(axis=1)
    # a part whose springs resist nothing has none of its own: its share is small rather than nothing
    unit = np.maximum(unit, LEAST * np.median(unit))
    stiffness = unit * np.exp(between(log_modulus, ends))
    anchor, spread = _global_anchor(topology, priors, volume, stiffness)
    beliefs = describe_beliefs(priors, shape.size, gravity)
    return Sample(
        edges=_whole(topology.springs),
        edge_part=_whole(ends),
        edge_features=_real(shape.edges),
        point_part=_whole(topology.part),
        part_scene=torch.zeros(len(priors), dtype=torch.long),
        motion=_real(motion.points),
        motion_global=_real(motion.whole[None]),
        distribution=_real(np.stack([prior.distribution for prior in priors])),
        prior_log_modulus=_real(log_modulus),
        prior_log_spread=_real(np.array([prior.properties["stiffness"].spread for prior in priors])),
        part_share=_real(volume / volume.sum()),
        part_features=_real(np.concatenate([shape.parts, beliefs], axis=1)),
        scene_features=_real(shape.scene[None]),
        log_unit_stiffness=_real(np.log(unit)),
        grips=_whole(topology.controller_springs[:, 1]),
        grip_features=_real(shape.grips),
        log_grip_anchor=_real(np.log(grip_stiffness(topology, stiffness))),
        global_anchor=_real(anchor[None]),
        global_spread=_real(spread[None]),
    )


def _global_anchor(
    topology: Topology,
    priors: Sequence[MaterialPrior],
    volume: Float64[Array, " K"],
    stiffness: Float64[Array, " E"],
) -> tuple[Float64[Array, "4"], Float64[Array, "4"]]:
    """Means and spreads in the coordinates of `GLOBALS`."""
    ratio, ratio_spread = pooled(priors, volume, "damping")
    (drag, drag_spread), (friction, friction_spread), (bounce, bounce_spread) = (
        pooled(priors, volume, name) for name in GLOBALS[1:]
    )
    dashpot = dashpot_damping(topology, stiffness, ratio)
    anchor = np.array([np.log(dashpot), np.log(drag), np.log(friction), np.log(bounce / (1.0 - bounce))])
    # d logit r = d ln r / (1 - r)
    return anchor, np.array([ratio_spread, drag_spread, friction_spread, bounce_spread / (1.0 - bounce)])


def _real(values: Float[Array, "..."]) -> Float[Tensor, "..."]:
    return torch.as_tensor(np.asarray(values, np.float32))


def _whole(values: Integer[Array, "..."]) -> Int64[Tensor, "..."]:
    return torch.as_tensor(values.astype(np.int64))
