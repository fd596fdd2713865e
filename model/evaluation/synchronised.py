"""A twin is led along what was seen of a clip before it says how the clip goes on."""

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import torch
from jaxtyping import Float32, Float64

from model.errors import InputError
from model.evaluation.baselines.base import Fitted, Method, PartBelief, SpringMass
from model.evaluation.kriging import Kriging
from model.gap.observer import corrected
from model.scenes.case import Case
from model.scenes.replay import observed, roll
from model.simulator.system import State
from model.types import Array, Parameters

PATIENCE = 0.1
"""How long an error lives [s]: noise and wrong forces ask for more, a wrong state for less."""


@dataclass(frozen=True)
class Synchronised(Method):
    """A method whose twins are led through the frames before the split, and go on from there.

    How a robot uses a twin: the frames that every method is given also say where the object is and how fast
    it moves. Parameters stay what the method says, and so does what it says of any other interaction.
    """

    inner: Method
    name: ClassVar[str] = "synchronised"

    def fit(self, case: Case) -> "Led":
        """As the method does.

        Raises:
            InputError: what it makes is no spring-mass twin.
        """
        return self.led(self.inner.fit(case), case)

    def led(self, twin: Fitted, case: Case) -> "Led":
        """What the method made of a case, led along it.

        Raises:
            InputError: it is no spring-mass twin.
        """
        if not isinstance(twin, SpringMass):
            raise InputError(f"{self.inner.name}: no springs and masses to lead: leave `-synchronised` out")
        return Led(twin, case)

    def identity(self) -> str:
        """With that of the method."""
        return f"{super().identity()} of {self.inner.identity()}"

    def weights(self) -> str | None:
        """The method's."""
        return self.inner.weights()

    def knew(self, source: str, object_name: str) -> bool:
        """As the method did."""
        return self.inner.knew(source, object_name)


@dataclass(frozen=True)
class Led:
    """A twin that knows how one clip began.

    The frames before the split are what the twin says without help. From the split on, the rollout goes on
    from a state that was led there by `Lead`, moved by what leading left of the error.
    """

    twin: SpringMass
    case: Case
    """What was seen; nothing from its split on is read."""

    @property
    def parameters(self) -> Parameters | None:
        """The twin's."""
        return self.twin.parameters

    @property
    def part_belief(self) -> PartBelief | None:
        """The twin's."""
        return self.twin.part_belief

    def predict(self, case: Case) -> Float32[Array, "T N 3"]:
        """The twin's motion [m], led where the clip was seen."""
        made = self.twin.predict(case)
        if case.name != self.case.name:
            return made
        lead = Lead(self.case)
        with torch.no_grad():
            points = roll(case, self.twin.simulator(case), lead=lead)
            led = observed(case.anchors, points).numpy() + lead.left
        return np.concatenate([made[: self.case.split], led[self.case.split :].astype(np.float32)])


@dataclass
class Lead:
    """A fixed-gain observer: each frame, what is seen moves the state that the twin expected.

    An error e, spread over the points by `Kriging`, corrects places by α e and velocities by β e / Δt, with
    α = 1 − exp(−Δt / τ) and β = α² / (2 − α). A twin whose forces are wrong is not where the object is,
    however long it is led: the mean of what is left, over τ too, is kept.

    Reference:
        Benedict and Bordner (1962), Synthesis of an optimal set of radar track-while-scan smoothing
        equations, IRE Transactions on Automatic Control 7 (the relation of α and β).
    """

    case: Case
    left: Float64[Array, "N 3"] = field(init=False)
    """Where observed points are, beyond where the twin has them [m]."""

    def __post_init__(self) -> None:
        """Begin at rest, where all is known."""
        case, known = self.case, self.case.observation.points[: self.case.split]
        self.left = np.zeros((len(case.rest), 3))
        self._points = known.astype(np.float64)
        self._there = np.asarray(np.isfinite(self._points).all(axis=-1))
        self._kriging = Kriging(case)

    def __call__(self, frame: int, state: State) -> State:
        """The state after the frame was looked at; from the split on there is nothing to look at."""
        if frame >= self.case.split or not self._there[frame].any():
            return state
        places, times = self._points[frame], self.case.observation.times
        expected = observed(self.case.anchors, state.positions[None])[0].double().numpy()
        error, seen_error = self._kriging(places - expected, self._there[frame], places)
        interval = float(times[frame] - times[frame - 1])
        alpha = 1.0 - float(np.exp(-interval / PATIENCE))
        self.left += alpha * ((1.0 - alpha) * seen_error - self.left)
        return corrected(state, torch.as_tensor(error).to(state.positions), alpha, interval)
