"""A case → something that says how the object moves: the seam that every method in the table fills."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32, Float64

from model.scenes.case import Case
from model.scenes.replay import case_simulator, replay
from model.simulator.simulator import Simulator
from model.types import Array, Parameters, Topology


class PartBelief(NamedTuple):
    """What a method believes of Young's modulus of each part: a log-normal."""

    log_modulus: Float64[Array, " K"]
    """Mean of ln E, E in Pa: such that `lattice_stiffness` of E, with volumes by the mean densities of the
    priors that the method was given, is the stiffness it means."""
    log_spread: Float64[Array, " K"] | None = None
    """Standard deviation of ln E; None where the method says nothing of how sure it is."""


@runtime_checkable
class Fitted(Protocol):
    """What a method made of one case."""

    @property
    def parameters(self) -> Parameters | None:
        """Of the topology of the case that was fitted; None where the method has none.

        None also where they are of another topology than the case's.
        """
        ...

    @property
    def part_belief(self) -> PartBelief | None:
        """Its belief per part; None where it has none, then the parameters alone are judged."""
        ...

    def predict(self, case: Case) -> Float32[Array, "T N 3"]:
        """Where the observed points are in every frame of `case` [m].

        Args:
            case: The case that was fitted, or another interaction of the same object. Its topology, rest,
                anchors and controllers may be used. Frames of the observation that are to be predicted are
                NaN: those from `split` on of the fitted case, all of another one. No truth is in it.

        Raises:
            SimulationDiverged: a state is not finite.
        """
        ...


@runtime_checkable
class SpringMass(Fitted, Protocol):
    """A prediction that is a rollout of springs and masses, which can be led."""

    def simulator(self, case: Case) -> Simulator:
        """What `predict` rolls out: over the mass points of the case, held as the case says."""
        ...


class Method(ABC):
    """One way to learn how an object moves from one clip of it. Made without arguments; picklable."""

    name: ClassVar[str]
    """In tables and on the command line."""
    version: ClassVar[str] = "3"
    """Counted up when its results change, by its own doing or the simulator's: results of another version are
    not those that an evaluation goes on from."""

    @abstractmethod
    def fit(self, case: Case) -> Fitted:
        """Learn from the frames before `case.split`; those from there on are NaN, and no truth is in it.

        The same case gives the same result: what is drawn by lot comes from a fixed seed.
        """

    def identity(self) -> str:
        """What its results depend on beside the case: kept results of another identity are not used."""
        return f"{type(self).__name__} {self.version}"

    def weights(self) -> str | None:
        """First digits of the SHA-256 of what it learned beforehand; None: nothing."""
        return None

    def knew(self, source: str, object_name: str) -> bool:
        """Whether it was trained on an object beforehand.

        Args:
            source: sha256 of the index of the folder that the object is of.
            object_name: Its name there.
        """
        return False


@dataclass(frozen=True)
class Twin:
    """What a method made of a case when it gives parameters to the case's own topology."""

    topology: Topology
    parameters: Parameters
    part_belief: PartBelief | None = None

    def predict(self, case: Case) -> Float32[Array, "T N 3"]:
        """Replay the case with these parameters, carried over to its grips."""
        return replay(case, self._carried(case))

    def simulator(self, case: Case) -> Simulator:
        """Of the case with these parameters."""
        return case_simulator(case, self._carried(case))

    def _carried(self, case: Case) -> Parameters:
        return carried(self.parameters, self.topology, case.topology)


def carried(parameters: Parameters, source: Topology, target: Topology) -> Parameters:
    """Parameters of one interaction for another one of the same object, which is held elsewhere.

    Springs keep their stiffness. A controller spring gets as much, over the mean of the springs of the point
    it holds, as those of the source have at the median; a source that is not held passes on 1.

    Args:
        parameters: Of `source`.
        source: The topology that they were found for.
        target: Its points and springs are those of `source`, its controllers need not be.
    """
    if np.array_equal(source.controller_springs, target.controller_springs):
        return parameters
    usual = _usual(target, parameters.stiffness)
    firmness = 1.0
    if len(source.controller_springs):
        held = usual[source.controller_springs[:, 1]]
        firmness = float(np.median(parameters.controller_stiffness / np.maximum(held, 1e-12)))
    grip = firmness * usual[target.controller_springs[:, 1]]
    return replace(parameters, controller_stiffness=grip.astype(np.float32))


def _usual(topology: Topology, stiffness: Float32[Array, " E"]) -> Float64[Array, " P"]:
    """Mean stiffness of the springs of each point [N/m]."""
    count = len(topology.points)
    total, degree = np.zeros(count), np.zeros(count)
    for side in (0, 1):
        total += np.bincount(topology.springs[:, side], stiffness.astype(np.float64), minlength=count)
        degree += np.bincount(topology.springs[:, side], minlength=count)
    return np.asarray(total / np.maximum(degree, 1.0), np.float64)
