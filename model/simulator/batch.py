"""Scenes of different size side by side in one system, so that one rollout moves them all."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Int
from torch import Tensor

from model.errors import InputError
from model.simulator.parameters import broadcast
from model.simulator.simulator import Rollout, Simulator
from model.simulator.system import State


@dataclass(frozen=True)
class Joined:
    """Several simulators as one; `join.join` makes it.

    Its simulator is like any other: on the fast path where the terms are, with gradients to whatever the
    constants of the scenes depend on. The scenes share frames and substeps: those of the one that needs most.
    """

    simulator: Simulator
    parts: tuple[Simulator, ...]

    @property
    def scene(self) -> Int[Tensor, " N"]:
        """Which scene each point belongs to."""
        counts = torch.tensor([len(part.system.points) for part in self.parts])
        return torch.repeat_interleave(torch.arange(len(counts)), counts)

    def state(self, states: Sequence[State | None]) -> State:
        """One state of all scenes; None: that scene rests.

        Raises:
            InputError: states of laws with memory, which cannot be joined.
        """
        given = [part.rest_state() if s is None else s for part, s in zip(self.parts, states, strict=True)]
        if any(state.memory for state in given):
            raise InputError("a state with memory cannot be joined: start the scenes from their first frame")
        return State(
            side_by_side([state.positions for state in given], -2),
            side_by_side([state.velocities for state in given], -2),
        )

    def controls(self, motions: Sequence[Tensor | np.ndarray | None], frames: int) -> Tensor | None:
        """One motion of all controllers [frames, *b, C, 3]; a shorter one stays where it ends, None rests."""
        held = []
        for number, (part, motion) in enumerate(zip(self.parts, motions, strict=True)):
            if not part.system.controller_count:
                continue
            rest = part.system.controller_points
            if motion is None and rest is None:
                raise InputError(f"scene {number} has controllers but no rest places of them: give controls")
            moved = rest[None] if motion is None and rest is not None else torch.as_tensor(motion)
            moved = moved[:frames].to(self.simulator.system.points)
            last = moved[-1:].expand(frames - len(moved), *moved.shape[1:])
            held.append(torch.cat([moved, last]))
        return side_by_side(held, -2) if held else None

    def rollout(
        self,
        states: Sequence[State | None] | None = None,
        controls: Sequence[Tensor | np.ndarray | None] | None = None,
        *,
        frames: Sequence[int],
        fps: float = 30.0,
        substeps: int | None = None,
        checkpoint: bool = False,
    ) -> list[Rollout]:
        """The rollout of each scene, for as many frames as it has.

        Args:
            states: Where each starts; None: at rest.
            controls: How the controllers of each move [T, *b, C, 3]; None: they stay at rest.
            frames: Of each.
            fps: Frames per second, of all.
            substeps: Per frame; None: as many as the scene needs that needs most.
            checkpoint: See `Simulator.rollout`.
        """
        none = [None] * len(self.parts)
        longest = max(frames)
        start = self.state(states or none)
        motion = self.controls(controls or none, longest)
        together = self.simulator.rollout(
            start, motion, frames=longest, fps=fps, substeps=substeps, checkpoint=checkpoint
        )
        return self.split(together, frames)

    def split(self, rollout: Rollout, frames: Sequence[int] | None = None) -> list[Rollout]:
        """What each scene did, in its own frames; its `end` is its last frame, without memory."""
        made, begin = list[Rollout](), 0
        lengths = frames or [len(rollout.times)] * len(self.parts)
        for part, length in zip(self.parts, lengths, strict=True):
            own = slice(begin, begin + len(part.system.points))
            points, velocities = (v[:length, ..., own, :] for v in (rollout.points, rollout.velocities))
            end = State(points[-1], velocities[-1])
            made.append(
                Rollout(rollout.times[:length], points, velocities, end, rollout.substeps[: length - 1])
            )
            begin = own.stop
        return made


def alike(needed: Sequence[int], waste: float = 1.5) -> list[list[int]]:
    """Scenes in groups that may share substeps: none takes more than `waste` times what it needs.

    Args:
        needed: Substeps that each scene needs (`Simulator.needed_substeps`).
        waste: At least 1.

    Returns:
        The scenes of each group, by their number, those that need least first.
    """
    groups: list[list[int]] = []
    for number in sorted(range(len(needed)), key=lambda n: needed[n]):
        if groups and needed[number] <= waste * needed[groups[-1][0]]:
            groups[-1].append(number)
        else:
            groups.append([number])
    return groups


def side_by_side(values: Sequence[Tensor], dim: int) -> Tensor:
    """Put one after another along `dim`; dimensions before the last `-dim` broadcast."""
    batch = broadcast(*(value.shape[:dim] for value in values))
    return torch.cat([value.expand(*batch, *value.shape[dim:]) for value in values], dim)
