"""What is compared with an observation: a simulator, what the hand does, and which points are seen."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float, Float64
from torch import Tensor

from model.gap.sight import Sight
from model.gap.size import size_of
from model.simulator.contacts.base import ContactTerm
from model.simulator.forces.base import ForceTerm
from model.simulator.forces.gravity import Gravity
from model.simulator.simulator import Lead, Rollout, Simulator
from model.simulator.system import State, System
from model.types import Array


@dataclass(frozen=True)
class World:
    """A twin as a diagnosis sees it. Effects make a new one of it; nothing changes one."""

    simulator: Simulator
    sight: Sight
    times: Float64[Array, " T"]
    """Of the frames [s]."""
    controls: Float[Tensor, "T *b C 3"] | None = None
    """What the hand is said to do [m]."""
    ground_height: float | None = None
    """[m]."""

    @property
    def system(self) -> System:
        """What moves."""
        return self.simulator.system

    @property
    def gravity(self) -> Float[Tensor, "*b 3"]:
        """[m/s²]; zero where no gravity acts."""
        if "gravity" not in self.simulator.forces:
            return torch.zeros(3, dtype=torch.float64)
        term = self.simulator.force("gravity")
        assert isinstance(term, Gravity)
        return term.value("gravity").detach()

    @property
    def spacing(self) -> float:
        """Median length of the springs at rest [m]; the size of the object where there is none."""
        points = self.system.points
        if not len(self.system.springs):
            return size_of(points.double().numpy())
        ends = points[self.system.springs]
        return float((ends[:, 1] - ends[:, 0]).norm(dim=-1).median())

    def with_force(self, force: ForceTerm) -> "World":
        """The same world with a force more, or in place of the one of its name."""
        return replace(self, simulator=self.simulator.with_force(force))

    def with_contact(self, contact: ContactTerm) -> "World":
        """The same world with a contact more, or in place of the one of its name."""
        return replace(self, simulator=self.simulator.with_contact(contact))

    def with_system(self, system: System) -> "World":
        """The same laws over another system of the same graph."""
        return replace(self, simulator=self.simulator.with_system(system))

    def rollout(
        self,
        state: State | None = None,
        first: int = 0,
        last: int | None = None,
        substeps: int | None = None,
        lead: Lead | None = None,
        *,
        lossy: bool = False,
    ) -> Rollout:
        """Move from frame `first` to frame `last`, both included.

        Args:
            state: At frame `first`; None: at rest.
            first: Frame to start from.
            last: Frame to end with; None: the last there is.
            substeps: Per frame, taken without a look; None: as many as stability asks for.
            lead: Called after each frame, counted from `first`; see `Simulator.rollout`.
            lossy: Those of many worlds that diverge are NaN from then on.
        """
        last = len(self.times) - 1 if last is None else last
        held = None if self.controls is None else self.controls[first : last + 1]
        return self.simulator.rollout(
            state,
            held,
            times=np.asarray(self.times[first : last + 1]),
            substeps=substeps,
            trusted=True,
            lossy=lossy,
            checkpoint=True,
            lead=lead,
        )
