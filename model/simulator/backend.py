"""How a rollout is computed: by the torch oracle, or by a compiled kernel that says the same."""

import warnings
from abc import ABC, abstractmethod
from typing import Literal, TypeAlias

import torch
from torch.utils.checkpoint import checkpoint as checkpointed

from model.errors import InputError
from model.simulator.contacts.self_collision import SelfCollision
from model.simulator.drive import Drive
from model.simulator.dynamics import Dynamics
from model.simulator.integrators.base import Integrator
from model.simulator.kernel.call import Interval
from model.simulator.kernel.cuda.kernel import CudaKernel
from model.simulator.kernel.kernel import Kernel
from model.simulator.kernel.terms import Inexpressible
from model.simulator.parameters import Values
from model.simulator.stability import Slopes, differentiate
from model.simulator.system import Anchors, State

Backend: TypeAlias = Literal["auto", "torch", "kernel"]
"""`auto`: a kernel where one can be had, else torch, with a warning."""


class FallbackWarning(UserWarning):
    """No kernel serves, so rollouts are slower than they could be."""


class Path(ABC):
    """What takes a state from one frame to the next."""

    @abstractmethod
    def advance(self, state: State, drive: Drive, dt: float, checkpoint: bool) -> State:
        """The state [m, m/s] after the substeps of a frame, of `dt` [s] each.

        Args:
            state: At the start of the frame.
            drive: The controllers during it.
            dt: Substep [s].
            checkpoint: Store the state alone for the backward pass, and compute the rest again there.
        """

    @property
    def look(self) -> int:
        """The least frames between two looks at `slopes`, for these to cost little beside the frames."""
        return 1

    @abstractmethod
    def slopes(self, state: State, anchors: Anchors | None) -> Slopes:
        """How accelerations change with places and velocities, near `state` [m, m/s]; see `stable_step`."""


class Oracle(Path):
    """Plain torch, one substep after another."""

    def __init__(self, dynamics: Dynamics, integrator: Integrator) -> None:
        """Of these terms."""
        self._dynamics, self._integrator = dynamics, integrator

    def advance(self, state: State, drive: Drive, dt: float, checkpoint: bool) -> State:
        """The state [m, m/s] after a frame."""
        if checkpoint and torch.is_grad_enabled():
            after: State = checkpointed(self._steps, state, drive, dt, use_reentrant=False)
            return after
        return self._steps(state, drive, dt)

    def slopes(self, state: State, anchors: Anchors | None) -> Slopes:
        """By reverse differentiation."""
        return differentiate(self._dynamics, state, anchors)

    def _steps(self, state: State, drive: Drive, dt: float) -> State:
        for substep in range(drive.count):
            state = self._integrator.step(self._dynamics, state, drive(substep), dt)
        return state


class FastPath(Path):
    """A compiled kernel, one call per frame."""

    def __init__(self, kernel: Kernel | CudaKernel, dynamics: Dynamics, meets: bool = False) -> None:
        """Through this kernel of these terms; `meets`: it has self-contact where no gradients flow."""
        self._kernel, self._dynamics, self._meets = kernel, dynamics, meets

    def advance(self, state: State, drive: Drive, dt: float, checkpoint: bool) -> State:
        """The state [m, m/s] after a frame."""
        keeps = torch.is_grad_enabled() and not checkpoint
        interval = Interval(dt, drive.count, drive.interval)
        return self._kernel.advance(state, drive.ends, interval, keeps)

    def meets(self, state: State, drive: Drive) -> bool:
        """Whether the object meets itself in a frame that starts in `state`, as the kernel computes it."""
        inputs = (state.positions, state.velocities, *state.memory.values(), *(drive.ends or ()))
        if not self._meets or isinstance(self._kernel, CudaKernel):
            return False
        return not self._kernel.differentiates(*inputs)

    @property
    def look(self) -> int:
        """Seldom where slopes come from torch and cost as much as many substeps: of a memory on a device."""
        remembers = any(term.memory for term, _ in self._dynamics.forces)
        return 4 if remembers and isinstance(self._kernel, CudaKernel) else 1

    def slopes(self, state: State, anchors: Anchors | None) -> Slopes:
        """By the adjoint of one substep."""
        return self._kernel.slopes(state, anchors) or differentiate(self._dynamics, state, anchors)


class Watched(Path):
    """The fast path while the object does not meet itself, the oracle for the frames in which it may.

    Without gradients the fast path does both.
    """

    def __init__(self, free: FastPath, whole: Path, meeting: SelfCollision) -> None:
        """`free` leaves out what `meeting` would do where gradients flow, `whole` does not."""
        self._free, self._whole, self._meeting = free, whole, meeting

    def advance(self, state: State, drive: Drive, dt: float, checkpoint: bool) -> State:
        """The state [m, m/s] after a frame: tried without contact, done again if there may have been one."""
        after = self._free.advance(state, drive, dt, checkpoint)
        if not self._free.meets(state, drive) and self._meeting.meets(state.positions, after.positions):
            return self._whole.advance(state, drive, dt, checkpoint)
        return after

    @property
    def look(self) -> int:
        """As without contact."""
        return self._free.look

    def slopes(self, state: State, anchors: Anchors | None) -> Slopes:
        """Impulses have none."""
        return self._free.slopes(state, anchors)


def choose_path(backend: Backend, dynamics: Dynamics, integrator: Integrator, batch: torch.Size) -> Path:
    """The fastest path that the terms allow, or the one asked for.

    Raises:
        InputError: a kernel is asked for and cannot be had; says why.

    Warns:
        FallbackWarning: `auto` falls back to torch; says why.
    """
    if backend == "torch":
        return Oracle(dynamics, integrator)
    meeting = next(((term, v) for term, v in dynamics.contacts if isinstance(term, SelfCollision)), None)
    try:
        if meeting is None or backend == "kernel":
            return _fast(dynamics, integrator, batch)
        # a kernel resolves it before all other contacts
        first = meeting if dynamics.contacts[0][0] is meeting[0] else None
        free = _fast(dynamics.without(meeting[0]), integrator, batch, first)
        return Watched(free, Oracle(dynamics, integrator), meeting[0])
    except Inexpressible as error:
        if backend == "kernel":
            raise InputError(f"no kernel can be had: {error}; use the backend 'torch'") from error
        warnings.warn(f"the torch oracle serves, slowly: {error}", FallbackWarning, stacklevel=3)
        return Oracle(dynamics, integrator)


def _fast(
    dynamics: Dynamics,
    integrator: Integrator,
    batch: torch.Size,
    meeting: tuple[SelfCollision, Values] | None = None,
) -> FastPath:
    """The kernel of these terms, on whichever device they are."""
    if dynamics.mass.device.type == "cuda":
        return FastPath(CudaKernel(dynamics, integrator, batch), dynamics)
    if meeting is None:
        return FastPath(Kernel(dynamics, integrator, batch), dynamics)
    return FastPath(Kernel(dynamics, integrator, batch, meeting), dynamics, meets=True)
