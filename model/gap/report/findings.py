"""What a diagnosis hands to its report."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from model.gap.schema import GapReport
from model.types import Array


@dataclass(frozen=True)
class Findings:
    """A gap report, and the arrays that its figures show.

    N observed points, T frames, C controllers. All in the world frame (z up).
    """

    report: GapReport
    times: Float[Array, " T"]
    """Of the frames [s]."""
    observed: Float[Array, "T N 3"]
    """What really moved [m]; NaN where not seen."""
    before: Float[Array, "T N 3"]
    """Rollout of the refitted twin at the same points [m]."""
    error_baseline: Float[Array, " T"]
    """Mean distance of visible points per frame [m] of the twin as it came; NaN where nothing is seen."""
    error_refit: Float[Array, " T"]
    """The same of the refitted twin."""
    rest: Float[Array, "N 3"]
    """The observed points at rest [m]."""
    controllers: Float[Array, "T C 3"]
    """Of the hands that hold some of it [m]."""
    after: Float[Array, "T N 3"] | None = None
    """Rollout with the verdict's effect [m]; None: the verdict has none."""
    error_after: Float[Array, " T"] | None = None
    """Its error per frame [m]."""
    ground_height: float | None = None
    """[m]; None: no ground."""
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """95 % intervals [m] of the figures in `report.gap` that have one, by key."""
    transfer_intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """The same of `report.gap.transfer`."""

    def __post_init__(self) -> None:
        """Arrays and report have to speak of the same points and frames."""
        frames, points = len(self.times), len(self.rest)
        where = self.report.where
        if (len(where.frames), len(where.points)) != (frames, points):
            found = f"{len(where.frames)} frames and {len(where.points)} points"
            raise ValueError(
                f"findings: the report is of {found}, the arrays of {frames} frames and {points} points"
            )
        if (self.after is None) != (self.error_after is None):
            raise ValueError("findings: after and error_after come together")
        if not np.isfinite(self.rest).all():
            raise ValueError("findings: rest has values that are not finite")

    def visible(self) -> Float[Array, " T"]:
        """Share of the points that is seen in each frame."""
        share: Float[Array, " T"] = np.isfinite(self.observed).all(-1).mean(-1)
        return share
