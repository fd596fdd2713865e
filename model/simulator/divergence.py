"""A rollout that left the numbers: where, when, and by which term."""

import math
from dataclasses import replace

import torch
from torch import Tensor

from model.errors import InputError
from model.simulator.drive import Drive
from model.simulator.dynamics import Dynamics, recalled
from model.simulator.integrators.base import Integrator
from model.simulator.system import Anchors, State


class SimulationDiverged(InputError):
    """A state is not finite any more.

    Attributes:
        frame: The frame that could not be reached.
        point: The first point that is not finite.
        term: The force term that broke it: the first not finite there, else the strongest.
    """

    def __init__(self, frame: int, point: int, term: str, substeps: int) -> None:
        """Say it in one line."""
        self.frame, self.point, self.term = frame, point, term
        super().__init__(
            f"the simulation diverged in frame {frame}: point {point} is not finite, driven by {term!r}; "
            f"use more than {substeps} substeps per frame, or less extreme parameters"
        )


def finite(state: State) -> bool:
    """Whether every coordinate and velocity is."""
    return all(_sound(values.detach()) for values in (state.positions, state.velocities))


def _sound(values: Tensor) -> bool:
    """Their sum is found fastest, and where it is a number all of them are; it may overflow where all are."""
    return math.isfinite(float(values.sum())) or bool(torch.isfinite(values).all())


def without_lost(state: State) -> State:
    """The state, in which worlds that are not finite somewhere are so nowhere.

    NaN stays what it is in all that follows, and reaches no other world of the batch.
    """
    lost = _bad(state).any(-1)[..., None, None]
    return replace(
        state,
        positions=state.positions.masked_fill(lost, math.nan),
        velocities=state.velocities.masked_fill(lost, math.nan),
    )


def all_lost(state: State) -> bool:
    """Whether nothing is left of a state that `without_lost` has gone through."""
    return bool(torch.isnan(state.positions).all())


def explain(
    dynamics: Dynamics,
    integrator: Integrator,
    start: State,
    drive: Drive,
    dt: float,
    substeps: int,
    frame: int,
) -> SimulationDiverged:
    """Repeat a frame that ended badly, and find the substep, the point and the term where it began."""
    with torch.no_grad():
        state = start
        for substep in range(substeps):
            after = integrator.step(dynamics, state, drive(substep), dt)
            if not finite(after):
                point = _first_bad(after)
                return SimulationDiverged(
                    frame, point, _culprit(dynamics, state, drive(substep), point), substeps
                )
            state = after
    return SimulationDiverged(frame, 0, "unknown", substeps)


def _bad(state: State) -> Tensor:
    """Which points are not finite, [*b, N]."""
    return ~(torch.isfinite(state.positions) & torch.isfinite(state.velocities)).all(-1)


def _first_bad(state: State) -> int:
    bad = _bad(state)
    return int(bad.reshape(-1, bad.shape[-1]).any(0).nonzero()[0])


def _culprit(dynamics: Dynamics, state: State, anchors: Anchors | None, point: int) -> str:
    motion = dynamics.motion(state, anchors)
    strongest, name = -1.0, "the initial state"
    for term, values in dynamics.forces:
        size = _largest(term.force(motion, recalled(term, values, state)), point)
        if not size < float("inf"):
            return term.name
        if size > strongest:
            strongest, name = size, term.name
    return name


def _largest(force: Tensor, point: int) -> float:
    return float(force.select(-2, point).abs().max())  # a norm would overflow first
