"""A simulator that goes on frame by frame, for as long as one likes."""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from model.simulator.backend import choose_path
from model.simulator.contacts.self_collision import SelfCollision
from model.simulator.divergence import explain, finite
from model.simulator.drive import Drive
from model.simulator.pace import Pace
from model.simulator.simulator import Simulator
from model.simulator.system import Anchors, State

FRAMES = 4096
"""After which the bound is found anew and the motion of the controllers is forgotten."""
LOOKS = 4
"""How often per frame points of the object are kept from going through each other. A rollout does so in every
substep, in plain torch, which takes a second a frame for an object that is folded."""


class Stepper:
    """Does what `Simulator.rollout` does, but one frame at a time, towards places known only then.

    Self-contact alone is coarser: see `LOOKS`.

    Args:
        simulator: What moves.
        state: Where it starts; what laws remember is kept where it fits, and at rest elsewhere.
        places: Where the controllers are [m]; None: there are none.
        interval: The longest frame to come [s].
    """

    def __init__(
        self, simulator: Simulator, state: State, places: Float[Tensor, "C 3"] | None, interval: float
    ) -> None:
        """See the class."""
        self._integrator = simulator.integrator
        with torch.no_grad():
            dynamics = simulator.dynamics()
            meeting = next((both for both in dynamics.contacts if isinstance(both[0], SelfCollision)), None)
            self._meeting, self._pieces = meeting, 1 if meeting is None else LOOKS
            self._dynamics = dynamics if meeting is None else dynamics.without(meeting[0])
            self._path = choose_path(simulator.backend, self._dynamics, self._integrator, torch.Size(()))
            anchors = None if places is None else Anchors(places, torch.zeros_like(places))
            rest = dynamics.rest_memory(state, anchors)
        self.state, self._longest = replace(state, memory=_kept(state, rest)), interval / self._pieces
        self._begin(places)

    def advance(self, places: Float[Tensor, "C 3"] | None, interval: float) -> int:
        """Move on by `interval` [s], the controllers ending at `places` [m].

        Returns:
            The substeps that it took.

        Raises:
            SimulationDiverged: a state is not finite; says point and term.
        """
        count, before = 0, None if self._motion is None else self._motion[self._frame].clone()
        for piece in range(1, self._pieces + 1):
            end = places
            if before is not None and places is not None:
                end = torch.lerp(before, places, piece / self._pieces)
            with torch.no_grad():
                count += self._piece(end, interval / self._pieces)
                if self._meeting is not None:
                    self._part(interval / self._pieces)
        return count

    def _piece(self, places: Float[Tensor, "C 3"] | None, interval: float) -> int:
        if self._frame == FRAMES:
            self._begin(None if self._motion is None else self._motion[-1].clone())
        self._frame += 1
        if self._motion is not None and places is not None:
            self._motion[self._frame] = places
        while True:
            count = self._pace.count(interval)
            drive = Drive(self._motion, self._frame, interval, count)
            after = self._path.advance(self.state, drive, interval / count, False)
            if self._pace.accepts(self.state, after, drive):
                break
        if not finite(after):
            dt = interval / count
            raise explain(self._dynamics, self._integrator, self.state, drive, dt, count, self._frame)
        self.state = after
        return count

    def _part(self, interval: float) -> None:
        """Stop points that run into each other."""
        assert self._meeting is not None
        term, values = self._meeting
        now = self.state
        velocities = term.resolve(now.positions, now.velocities, self._dynamics.mass, interval, values)
        self.state = replace(now, velocities=velocities)

    def _begin(self, places: Float[Tensor, "C 3"] | None) -> None:
        """Find the stability bound where the state is now."""
        self._frame = 0
        self._motion = None if places is None else places.repeat(FRAMES + 1, 1, 1)
        self._pace = Pace(self._dynamics, self._path, None)
        anchors = None if places is None else Anchors(places, torch.zeros_like(places))
        with torch.no_grad():
            self._pace.start(self.state, anchors, self._longest)


def _kept(state: State, rest: dict[str, Tensor]) -> dict[str, Tensor]:
    """What the laws remember, springs first: controllers may have come or gone since."""
    memory = {}
    for name, fresh in rest.items():
        memory[name] = kept = fresh.clone()
        if name in state.memory:
            both = min(kept.shape[-1], state.memory[name].shape[-1])
            kept[..., :both] = state.memory[name][..., :both]
    return memory
