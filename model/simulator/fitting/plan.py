"""How a fit spends its evaluations."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

from model.errors import InputError

FIRST = (3, 6, 12, 20, 30)
"""Frames of the first horizons; later ones are half as long again."""


FEW = 12
"""Free values up to which finite differences cost less than gradients save."""
Method: TypeAlias = Literal["auto", "lbfgs", "gauss_newton"]


@dataclass(frozen=True)
class Stage:
    """One horizon of a fit."""

    horizon: int
    """Frames after frame 0."""
    refine: float
    """Substeps, as a multiple of those that stability asks for with its margin."""
    last: bool
    """Minimise to the end, rather than until it no longer pays."""


@dataclass(frozen=True)
class Plan:
    """Horizons, substeps, starts and budget of a fit.

    Evaluations of loss and gradient are the currency, a rollout without gradient a third of one: fits of one
    budget may be compared.

    Raises:
        InputError: a number that cannot be; says which.

    Reference:
        DESIGN section 7 (progressive horizons were the only way that was good on damped and floppy objects).
    """

    evaluations: int = 120
    """For each start."""
    horizons: tuple[int, ...] | None = None
    """Frames after frame 0 that are looked at, one stage after another; None: 3, 6, 12, 20, 30, …, all."""
    finish: float = 0.4
    """Share of the evaluations that is kept for the stage that ends the fit; it gets one at least."""
    refine: float = 2.0
    """Substeps of a last stage, as a multiple of what stability asks for: gradients converge more slowly
    than trajectories. 1: no such stage."""
    restarts: int = 0
    """Further starts, from perturbed places."""
    spread: float = 0.7
    """By how much they are perturbed: one standard deviation, of the natural logarithm or in scales."""
    seed: int = 0
    """Of the perturbation."""
    tolerance: float = 1e-3
    """A fit has converged where its loss may still fall by no more than this share; see `Verdict.left`."""
    method: Method = "auto"
    """`lbfgs` by gradients of rollouts; `gauss_newton` by finite differences; `auto`: the latter for up to
    `FEW` unknowns, which it serves better and whose contacts it understands."""
    checkpoint: bool = True
    """Store one state per frame for the backward pass: a third more time, a hundredth of the memory."""

    def __post_init__(self) -> None:
        """Check it."""
        if self.evaluations < 1 or self.restarts < 0:
            raise InputError(
                f"{self.evaluations} evaluations and {self.restarts} restarts: give at least 1 and at least 0"
            )
        if not (0 < self.finish <= 1 and self.refine >= 1 and self.spread >= 0 and self.tolerance > 0):
            raise InputError("a plan needs finish in 0 … 1, refine from 1, and tolerance above 0")
        if self.horizons is not None and (not self.horizons or min(self.horizons) < 1):
            raise InputError(f"horizons are {self.horizons}: give at least one, of at least 1 frame each")

    def stages(self, frames: int) -> tuple[Stage, ...]:
        """What there is to do for an interaction of so many frames, frame 0 included.

        Raises:
            InputError: fewer than two frames.
        """
        if frames < 2:
            raise InputError(f"a fit needs two frames or more, and has {frames}")
        wanted = progressive(frames - 1) if self.horizons is None else self.horizons
        horizons = sorted({min(horizon, frames - 1) for horizon in wanted})
        made = [Stage(horizon, 1.0, False) for horizon in horizons]
        if self.refine == 1:
            return (*made[:-1], Stage(horizons[-1], 1.0, True))
        return (*made, Stage(horizons[-1], self.refine, True))

    def budget(self, stages: tuple[Stage, ...], number: int, used: float) -> float:
        """Evaluations for stage `number`, when `used` are gone: what earlier ones left over is shared."""
        left = max(0.0, self.evaluations - used)
        if stages[number].last:
            return left
        before_last = left - max(1.0, self.finish * self.evaluations)
        return max(0.0, before_last / (len(stages) - 1 - number))


def progressive(horizon: int) -> tuple[int, ...]:
    """3, 6, 12, 20, 30 frames, then half as long again each time, up to `horizon`."""
    made = [frames for frames in FIRST if frames < horizon]
    while made and made[-1] >= FIRST[-1] and made[-1] * 1.5 < horizon:
        made.append(round(made[-1] * 1.5))
    return (*made, horizon)
