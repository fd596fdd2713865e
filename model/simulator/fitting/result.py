"""What a fit comes to."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from torch import Tensor

from model.simulator.fitting.covariance import Covariance
from model.simulator.fitting.minimise import Outcome
from model.simulator.fitting.plan import Stage
from model.simulator.fitting.scene import Scene


@dataclass(frozen=True)
class Step:
    """One evaluation of a fit."""

    start: int
    """0: the start that was given; above: restarts."""
    horizon: int
    """Frames after frame 0."""
    cost: float
    """Evaluations that this start has used so far; a rollout without gradient is a third of one."""
    loss: float
    """Mean square residual per coordinate, in units of noise; infinite where the step was rejected."""


Watch: TypeAlias = Callable[[Step], None]
"""Called after each evaluation."""


@dataclass(frozen=True)
class StageResult:
    """What one horizon came to."""

    stage: Stage
    substeps: int
    cost: float
    rejected: int
    """Evaluations that were not finite."""
    before: float
    """Loss at its start."""
    after: float
    """Loss at its end."""
    outcome: Outcome


@dataclass(frozen=True)
class Verdict:
    """Whether a fit ended well."""

    outcome: Outcome
    """`converged`: there is nothing left to gain; `stalled`: the loss no longer falls, though its slope says
    that it should (noise of contacts or of rounding); `budget`: it was still falling; `diverged`: no rollout
    from there is finite."""
    left: float
    """By which share the loss may still fall: by the curvature that Gauss-Newton knows, or, by L-BFGS, per
    unit of the steepest coordinate."""
    at_bounds: tuple[str, ...]
    """Parameters that a bound holds back."""
    statement: str
    """One sentence."""


@dataclass(frozen=True)
class Ended:
    """Where one start led."""

    start: Mapping[str, Tensor]
    """Free values by name, in their units, that it began with."""
    values: Mapping[str, Tensor]
    """Those that it ended with."""
    loss: float
    """Over the whole horizon, with the substeps of the last stage."""
    stages: tuple[StageResult, ...]
    history: tuple[Step, ...]
    verdict: Verdict


@dataclass(frozen=True)
class Fit:
    """What was found."""

    values: Mapping[str, Tensor]
    """Free values by name, in their units, from the best start."""
    scene: Scene
    """The scene with them."""
    loss: float
    """Mean square residual per coordinate, in units of noise, priors included."""
    error: float
    """Mean distance of seen points from where they would be [m]."""
    heldout_error: float | None
    """The same over what was held out [m]; None: nothing was."""
    verdict: Verdict
    """Of the best start."""
    starts: tuple[Ended, ...]
    """Every start, the given one first: how far they agree says how far to trust the fit."""
    evaluations: float
    """Used by all starts; a rollout without gradient is a third of one."""
    covariance: Covariance | None

    @property
    def best(self) -> Ended:
        """The start with the lowest loss."""
        return min(self.starts, key=lambda each: each.loss)
