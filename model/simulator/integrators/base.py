"""An integrator: how a state becomes the next one."""

from abc import ABC, abstractmethod
from typing import ClassVar

from model.simulator.dynamics import Dynamics
from model.simulator.system import Anchors, State


class Integrator(ABC):
    """One step of time; it knows no force and no contact."""

    name: ClassVar[str]
    order: ClassVar[int]
    """The error after a fixed time falls as dt to this power."""

    @abstractmethod
    def step(self, dynamics: Dynamics, state: State, anchors: Anchors | None, dt: float) -> State:
        """The state [m, m/s] after `dt` [s]; `anchors` is where the controllers are at the end of it."""
