"""The simulator: a system, what acts on it, and how time advances."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from model.errors import InputError
from model.simulator.backend import Backend, Path, choose_path
from model.simulator.contacts.base import ContactTerm
from model.simulator.divergence import all_lost, explain, finite, without_lost
from model.simulator.drive import Drive, clock
from model.simulator.dynamics import Dynamics
from model.simulator.forces.base import ForceTerm
from model.simulator.integrators.base import Integrator
from model.simulator.integrators.semi_implicit_euler import SemiImplicitEuler
from model.simulator.pace import MARGIN, Pace, Steady, substeps_for
from model.simulator.parameters import broadcast
from model.simulator.stability import StabilityWatch
from model.simulator.system import Anchors, State, System, check_shapes

ROUNDED = 12
"""Decimals of an interval [s]: frames that only the rounding of their times makes unlike share constants."""
Progress: TypeAlias = Callable[[int, int], None]
"""Called after each frame with the frames done and the frames there are."""
Lead: TypeAlias = Callable[[int, State], State]
"""Given a frame and the state predicted for it, the state to go on from."""


@dataclass(frozen=True)
class Rollout:
    """What a simulator did; frame 0 is the state it started from."""

    times: Float[Tensor, " T"]
    """[s]."""
    points: Float[Tensor, "T *b N 3"]
    """[m]."""
    velocities: Float[Tensor, "T *b N 3"]
    """[m/s]."""
    end: State
    """The state of the last frame, from which another rollout may go on."""
    substeps: tuple[int, ...]
    """Per frame interval."""


class Simulator(nn.Module):
    """Composes force terms, contact terms and an integrator over a system; it owns no physics itself.

    Args:
        system: What moves.
        forces: What acts on it; names must differ.
        contacts: What it meets, resolved in this order in each substep.
        integrator: How time advances.
        backend: What computes rollouts; `auto` compiles a kernel where one can be had.

    Raises:
        InputError: two terms of one name, or constants whose shape does not fit the system.
    """

    def __init__(
        self,
        system: System,
        forces: Sequence[ForceTerm],
        contacts: Sequence[ContactTerm] = (),
        integrator: Integrator | None = None,
        backend: Backend = "auto",
    ) -> None:
        """See the class."""
        super().__init__()
        names: list[str] = [*(term.name for term in forces), *(term.name for term in contacts)]
        if len(set(names)) < len(names):
            raise InputError(f"two terms of the simulator have the same name: {', '.join(sorted(names))}")
        self.system = system
        self.forces = nn.ModuleDict({term.name: term for term in forces})
        self.contacts = nn.ModuleDict({term.name: term for term in contacts})
        self.integrator, self.backend = integrator or SemiImplicitEuler(), backend
        for name, term in zip(names, [*forces, *contacts], strict=True):
            check_shapes(term, system, name)

    def force(self, name: str) -> ForceTerm:
        """The force term of that name."""
        term = self.forces[name]
        assert isinstance(term, ForceTerm)
        return term

    def contact(self, name: str) -> ContactTerm:
        """The contact term of that name."""
        term = self.contacts[name]
        assert isinstance(term, ContactTerm)
        return term

    def with_force(self, force: ForceTerm) -> "Simulator":
        """A new simulator with `force` added, or in place of the one of its name; all else is shared."""
        forces = {**{name: self.force(name) for name in self.forces}, force.name: force}
        return self._with(list(forces.values()), self._contacts())

    def with_contact(self, contact: ContactTerm) -> "Simulator":
        """A new simulator with `contact` first, or in place of the one of its name; all else is shared."""
        contacts = {contact.name: contact, **{term.name: term for term in self._contacts()}}
        contacts[contact.name] = contact
        return self._with(self._forces(), list(contacts.values()))

    def with_system(self, system: System) -> "Simulator":
        """The same terms over another system of the same graph."""
        return Simulator(system, self._forces(), self._contacts(), self.integrator, self.backend)

    def with_backend(self, backend: Backend) -> "Simulator":
        """The same simulator, its rollouts computed by `backend`."""
        return Simulator(self.system, self._forces(), self._contacts(), self.integrator, backend)

    def dynamics(self) -> Dynamics:
        """All terms with their constants evaluated, as the integrator wants them."""
        return Dynamics(self.system, self._forces(), self._contacts())

    def rest_state(self) -> State:
        """At rest positions and at rest."""
        return self.system.rest_state()

    def step(self, state: State, anchors: Anchors | None, dt: float) -> State:
        """One substep of `dt` [s]; `anchors` is where the controllers are at its end."""
        dynamics = self.dynamics()
        return self.integrator.step(dynamics, _remembering(dynamics, state, anchors), anchors, dt)

    def needed_substeps(self, interval: float, state: State | None = None, margin: float = MARGIN) -> int:
        """Substeps that keep `interval` [s] stable near `state`, with a margin; see `StabilityWatch`."""
        with torch.no_grad():
            dynamics = self.dynamics()
            start = self._start(dynamics, state, None)
            anchors = self._held()
            now = _remembering(dynamics, start, anchors)
            path = choose_path(self.backend, dynamics, self.integrator, now.positions.shape[:-2])
            limit = StabilityWatch(dynamics, path.slopes).find(now, anchors)
            return substeps_for(interval, limit, margin)

    def forward(self, *args: object, **kwargs: object) -> Rollout:
        """Same as `rollout`, so that `torch.func.functional_call` reaches it."""
        return self.rollout(*args, **kwargs)  # type: ignore[arg-type]

    def rollout(
        self,
        state: State | None = None,
        controls: Float[Tensor, "T *b C 3"] | Float[np.ndarray, "T C 3"] | None = None,
        *,
        frames: int | None = None,
        fps: float = 30.0,
        times: Sequence[float] | Float[np.ndarray, " T"] | None = None,
        substeps: int | None = None,
        trusted: bool = False,
        lossy: bool = False,
        checkpoint: bool = False,
        progress: Progress | None = None,
        lead: Lead | None = None,
    ) -> Rollout:
        """A trajectory of T frames, frame 0 being `state`.

        Args:
            state: Where to start; None: at rest.
            controls: Motion of the controllers [m], linear between frames; None: they stay at rest.
            frames: T, where neither `controls` nor `times` says it.
            fps: Frames per second, where `times` does not say it.
            times: Time of each frame [s], strictly increasing.
            substeps: Per frame interval; None: what the stability bound asks for, with a margin, frame by
                frame (`Pace`).
            trusted: Take `substeps` without a look whether they are enough, for who has asked
                `needed_substeps` before.
            lossy: Worlds of a batch that diverge are NaN from then on, and the others go on; without it one
                is enough to raise. Needs `trusted` substeps: who looks for them would lose all to one.
            checkpoint: Store one state per frame for the backward pass and compute the rest again there.
            progress: Called after each frame.
            lead: Called after each frame with its number and the state; the next frame starts from what it
                returns (an observer that follows a measurement).

        Raises:
            InputError: controls, times and frames that do not fit each other or the system.
            SimulationDiverged: a state is not finite; says frame, point and term. Not if `lossy`.
            TooManySubsteps: a frame would take more than can be paid.

        Warns:
            StabilityWarning: `substeps` is below the stability bound; says in which frame.
            FallbackWarning: no kernel can be had; says why.
        """
        if lossy and (substeps is None or not trusted):
            raise ValueError("a lossy rollout needs substeps that are trusted")
        moments = clock(times, frames if controls is None else len(controls), fps)
        motion = self._controls(controls, len(moments))
        dynamics = self.dynamics()
        now = self._start(dynamics, state, motion)
        held = None if motion is None else Anchors(motion[0].detach(), torch.zeros_like(motion[0]))
        now = _remembering(dynamics, now, held)
        path = choose_path(self.backend, dynamics, self.integrator, now.positions.shape[:-2])
        intervals = [float(interval) for interval in np.diff(moments).round(ROUNDED)]
        if 0.0 in intervals:
            after = intervals.index(0.0) + 1
            apart = moments[after] - moments[after - 1]
            raise InputError(
                f"frame {after} comes {apart:.3g} s after the one before, too soon to be told from it: "
                "give times in seconds, or a lower frame rate"
            )
        pace = Pace(dynamics, path, substeps) if substeps is None or not trusted else Steady(substeps)
        if intervals:
            pace.start(now, held, max(intervals))
        history, counts, count = [now], list[int](), 0
        for frame, interval in enumerate(intervals, start=1):
            if not (lossy and all_lost(now)):
                now, count = self._frame(
                    dynamics, path, pace, now, motion, frame, interval, checkpoint, lossy
                )
            if lead is not None:
                now = lead(frame, now)
            history.append(now)
            counts.append(count)
            if progress is not None:
                progress(frame, len(moments) - 1)
        return Rollout(
            torch.from_numpy(moments),
            torch.stack([s.positions for s in history]),
            torch.stack([s.velocities for s in history]),
            now,
            tuple(counts),
        )

    def _frame(
        self,
        dynamics: Dynamics,
        path: Path,
        pace: Pace | Steady,
        before: State,
        motion: Tensor | None,
        frame: int,
        interval: float,
        checkpoint: bool,
        lossy: bool,
    ) -> tuple[State, int]:
        """The state one frame on, and the substeps that it took."""
        while True:
            count = pace.count(interval)
            drive, dt = Drive(motion, frame, interval, count), interval / count
            after = path.advance(before, drive, dt, checkpoint)
            if pace.accepts(before, after, drive):
                break
        if not finite(after):
            if lossy:
                return without_lost(after), count
            raise explain(dynamics, self.integrator, before, drive, dt, count, frame)
        return after, count

    def _start(self, dynamics: Dynamics, state: State | None, motion: Tensor | None) -> State:
        """The state to start from, with the batch that the constants and controls have."""
        start = state or self.rest_state()
        if start.positions.shape[-2:] != self.system.points.shape:
            raise InputError(
                f"the state has {start.positions.shape[-2]} points, the system {len(self.system.points)}"
            )
        controlled = torch.Size(()) if motion is None else motion.shape[1:-2]
        batch = broadcast(dynamics.batch, controlled, start.positions.shape[:-2])
        shape = (*batch, *self.system.points.shape)
        return replace(
            start, positions=start.positions.expand(shape), velocities=start.velocities.expand(shape)
        )

    def _controls(self, controls: Tensor | np.ndarray | None, frames: int) -> Tensor | None:
        """Motion of the controllers [m], shape [T, *b, C, 3]; None where nothing is held."""
        count = self.system.controller_count
        if not count:
            return None
        if controls is None:
            held = self._held()
            assert held is not None
            return held.positions.expand(frames, -1, -1)
        motion = torch.as_tensor(controls).to(self.system.points)
        if len(motion) != frames or motion.shape[-2:] != (count, 3):
            raise InputError(
                f"controls have shape {list(motion.shape)}: the controllers need [{frames}, {count}, 3]"
            )
        if not bool(torch.isfinite(motion.detach()).all()):
            raise InputError("controls are not finite: give a place [m] of every controller in every frame")
        return motion

    def _held(self) -> Anchors | None:
        """The controllers at rest."""
        if not self.system.controller_count:
            return None
        held = self.system.controller_points
        if held is None:
            raise InputError("the system has controllers but no rest places of them: give controls")
        return Anchors(held, torch.zeros_like(held))

    def _with(self, forces: list[ForceTerm], contacts: list[ContactTerm]) -> "Simulator":
        return Simulator(self.system, forces, contacts, self.integrator, self.backend)

    def _forces(self) -> list[ForceTerm]:
        return [self.force(name) for name in self.forces]

    def _contacts(self) -> list[ContactTerm]:
        return [self.contact(name) for name in self.contacts]


def _remembering(dynamics: Dynamics, state: State, anchors: Anchors | None) -> State:
    """The state with the memory of what has long been at rest, of what it does not remember yet."""
    return replace(state, memory={**dynamics.rest_memory(state, anchors), **state.memory})
