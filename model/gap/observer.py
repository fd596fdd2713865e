"""A simulation that is led by an observation, and by how much it has to be led."""

from copy import copy
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from model.gap.size import size_of
from model.gap.world import World
from model.simulator.simulator import Rollout
from model.simulator.system import State
from model.types import Observation

LOST = 0.25
"""Innovations are bounded by this share of the object's size: beyond it a prediction is just wrong."""


@dataclass(frozen=True)
class Led:
    """What an observer saw."""

    predicted: Float[Tensor, "T *b N 3"]
    """Where the points were expected before each frame was looked at [m]."""
    rollout: Rollout
    """The states after each frame was looked at."""

    @property
    def lost(self) -> Bool[Tensor, " *b"]:
        """Which of the worlds diverged, of a lossy run."""
        lost: Tensor = torch.isnan(self.rollout.end.positions).flatten(-2).all(-1)
        return lost


class Observer:
    """A fixed-gain observer: predicts each frame, then moves the state towards what is seen.

    An error e of the seen points, spread over the mass points near them, corrects places by α e and
    velocities by β e / Δt with α = 1 − exp(−Δt / τ) and β = α²/(2 − α).

    Args:
        observation: What is seen.
        world: Any world of the object, for its rest shape.
        patience: τ [s], in which an error is forgotten; infinite: an open-loop rollout.

    Reference:
        Benedict and Bordner (1962), Synthesis of an optimal set of radar track-while-scan smoothing
        equations, IRE Transactions on Automatic Control 7 (the relation of α and β).
    """

    def __init__(self, observation: Observation, world: World, patience: float) -> None:
        """See the class."""
        self.patience = patience
        dtype = world.system.points.dtype
        points = torch.from_numpy(observation.points).to(dtype)
        self.seen: Bool[Tensor, "T N"] = torch.isfinite(points[..., 0])
        self.places: Float[Tensor, "T N 3"] = torch.nan_to_num(points)
        rest = world.sight(world.system.points)
        self.lost = LOST * size_of(world.system.points.double().numpy())
        apart = torch.cdist(world.system.points, rest)
        reach = torch.maximum(apart.amin(1, keepdim=True), torch.tensor(0.7 * world.spacing, dtype=dtype))
        self._spread: Float[Tensor, "P N"] = torch.exp(-0.5 * (apart / reach) ** 2)

    def forgetting(self, patience: float) -> "Observer":
        """The same, but for how long an error lives [s]."""
        other = copy(self)
        other.patience = patience
        return other

    def bounded(self, error: Float[Tensor, "*b 3"]) -> Float[Tensor, "*b 3"]:
        """Errors [m] the same way, each as a whole no longer than `lost`.

        Not coordinate by coordinate, none of which is the same in a turned world.
        """
        far = error.norm(dim=-1, keepdim=True) / self.lost
        bounded: Tensor = error * (torch.tanh(far) / far.clamp_min(1e-9))
        return bounded

    def lead(
        self,
        world: World,
        start: State | None = None,
        first: int = 0,
        last: int | None = None,
        until: int | None = None,
        substeps: int | None = None,
        *,
        lossy: bool = False,
    ) -> Led:
        """Run from frame `first` to `last`, led in frames up to `until`, free after it.

        Args:
            world: Maybe many at once, of batch [*b].
            start: At frame `first`; None: at rest.
            first: Frame to start from.
            last: Frame to end with; None: the last there is.
            until: Last frame that is looked at; None: all.
            substeps: Per frame; None: as many as stability asks for.
            lossy: Those of many worlds that diverge are NaN from then on.

        Raises:
            SimulationDiverged: a state is not finite. Not if `lossy`.
        """
        last = len(world.times) - 1 if last is None else last
        predicted: list[Tensor] = []

        def look(frame: int, state: State) -> State:
            expected = world.sight(state.positions)
            predicted.append(expected)
            if np.isinf(self.patience) or (until is not None and first + frame > until):
                return state
            interval = float(world.times[first + frame] - world.times[first + frame - 1])
            return self._corrected(state, expected, first + frame, interval)

        substeps = substeps or self.substeps(world, start)
        rollout = world.rollout(start, first, last, substeps, look, lossy=lossy)
        predicted.insert(0, world.sight(rollout.points[0]))
        return Led(torch.stack(predicted), rollout)

    def substeps(self, world: World, start: State | None = None) -> int:
        """What stability asks for, for the longest interval there is, at rest and where it starts.

        Another recording begins in another pose, in which a spring that stiffens may be strained.
        """
        interval, asked = float(np.diff(world.times).max()), world.simulator.needed_substeps
        return asked(interval) if start is None else max(asked(interval), asked(interval, start))

    def _corrected(self, state: State, expected: Tensor, frame: int, interval: float) -> State:
        seen = self.seen[frame].to(expected.dtype)
        error = (self.places[frame] - expected) * seen.unsqueeze(-1)
        weight = self._spread * seen
        # one product of all worlds, not one for each
        flat = error.movedim(-2, 0).reshape(error.shape[-2], -1)
        total = (weight @ flat).reshape(len(weight), *error.shape[:-2], 3).movedim(0, -2)
        moved = total / (weight.sum(-1, keepdim=True) + 0.1)
        return corrected(state, moved, 1.0 - float(np.exp(-interval / self.patience)), interval)


def corrected(state: State, error: Tensor, gain: float, interval: float) -> State:
    """A state moved by a share of the error of its places [m], and by what that says of its velocities.

    Args:
        state: That was expected.
        error: Of each mass point, of the shape of the positions.
        gain: α, 0..1; β is α² / (2 − α).
        interval: Since the last look [s].
    """
    return State(
        state.positions + gain * error,
        state.velocities + gain**2 / (2.0 - gain) / interval * error,
        state.memory,
    )
