"""What the fits of springs share: rolling a case out on other springs, and what comes of it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float, Float32, Float64
from torch import Tensor

from model.evaluation.baselines.base import PartBelief, carried
from model.evaluation.baselines.wiring import hold, with_springs
from model.formats.parameters import REQUIRED, UNITS
from model.predictor.affordable import MARGIN, SUBSTEPS, affordable
from model.predictor.lattice import lattice_stiffness
from model.predictor.prior_mean import PriorMeanPredictor
from model.predictor.prior_means import volumes
from model.predictor.stability import fastest, stable_step
from model.scenes.case import Case
from model.scenes.replay import case_simulator, observed, replay, roll, topology_simulator
from model.simulator.parameters import TensorLike
from model.simulator.simulator import Simulator
from model.types import Array, Parameter, Parameters, Topology

GLOBALS = {name: UNITS[name] for name in REQUIRED}
"""What has one value for the whole object, and its unit."""
LEAST = {"dashpot_damping": 1e-5, "drag_rate": 1e-3, "friction": 1e-2, "restitution": 1e-2}
MOST_RESTITUTION = 0.95


@dataclass(frozen=True)
class Mechanics:
    """Springs and what they are made of."""

    topology: Topology
    stiffness: Float64[Array, " E"]
    """[N/m]."""
    grip: Float64[Array, " S"]
    """Of controller springs [N/m]."""
    globals: Mapping[str, float]
    """Those of `GLOBALS`."""

    def limited(self) -> "Mechanics":
        """Softer springs and dashpots, where explicit integration would need more than `SUBSTEPS`."""
        dashpot = self.globals["dashpot_damping"]
        may = affordable(self.topology, self.stiffness, self.grip, dashpot)
        return replace(
            self,
            stiffness=self.stiffness * may.stiffness,
            grip=self.grip * may.stiffness,
            globals={**self.globals, "dashpot_damping": dashpot * may.dashpot},
        )

    def stiffer(self) -> float:
        """By which factor all springs may be stiffened within `SUBSTEPS`, at least 1."""
        frequency_squared = fastest(self.topology, self.stiffness, self.grip)
        decay = self.globals["dashpot_damping"] * fastest(
            self.topology, np.ones(len(self.stiffness)), np.ones(len(self.grip))
        )
        substeps = MARGIN / (30.0 * stable_step(frequency_squared, decay))
        return max(1.0, (SUBSTEPS / substeps) ** 2)

    def parameters(self) -> Parameters:
        """As a twin has them, without what its replay does not need."""
        entries = {name: Parameter(self.globals[name], unit, "fitted") for name, unit in GLOBALS.items()}
        return Parameters(self.stiffness.astype(np.float32), self.grip.astype(np.float32), entries)


def prior_globals(case: Case) -> dict[str, float]:
    """The global parameters that the prior means, within what may be fitted."""
    seen = case.observation
    parameters = PriorMeanPredictor().from_priors(
        case.topology, case.priors, case.shape_class, seen.gravity, seen.ground_height
    )
    values = {name: float(np.asarray(parameters.globals[name].value)) for name in GLOBALS}
    values = {name: max(value, LEAST[name]) for name, value in values.items()}
    return {**values, "restitution": min(values["restitution"], MOST_RESTITUTION)}


def prior_modulus(case: Case) -> float:
    """Young's modulus of the object as one piece by its priors: their geometric mean by volume [Pa]."""
    volume = volumes(case.topology, case.priors)
    logs = np.log([prior.properties["stiffness"].mean for prior in case.priors])
    return float(np.exp(volume @ logs / volume.sum()))


def unit_stiffness(case: Case, topology: Topology) -> Float64[Array, " E"]:
    """Springs of `topology` [N/m per Pa] of an object that is one piece and has one modulus, k = Y/L.

    As PhysTwin has it, but such that other springs between the same points need no other modulus.
    """
    whole = replace(topology, part=np.zeros_like(topology.part))
    return lattice_stiffness(
        whole, np.ones(1), volumes(case.topology, case.priors).sum(keepdims=True), case.shape_class
    )


def grip_stiffness(topology: Topology, stiffness: Float64[Array, " E"]) -> Float64[Array, " S"]:
    """Of each controller spring, the mean of the springs of the point that it holds [N/m]."""
    free = replace(
        topology,
        controller_springs=topology.controller_springs[:0],
        controller_rest_length=topology.controller_rest_length[:0],
    )
    own = Parameters(stiffness.astype(np.float32), np.zeros(0, np.float32), {})
    held = topology if len(topology.controller_springs) else free
    return carried(own, free, held).controller_stiffness.astype(np.float64)


def to_coordinates(values: Mapping[str, float]) -> Float[Tensor, " 4"]:
    """Logarithms of global parameters, the logit of restitution."""
    logs = [float(np.log(max(values[name], LEAST[name]))) for name in GLOBALS]
    share = float(np.clip(values["restitution"], LEAST["restitution"], MOST_RESTITUTION))
    return torch.tensor([*logs[:3], float(np.log(share / (1.0 - share)))], dtype=torch.float32)


def from_coordinates(z: Float[Tensor, " 4"]) -> dict[str, Tensor]:
    """Global parameters of their coordinates."""
    return dict(zip(GLOBALS, (z[0].exp(), z[1].exp(), z[2].exp(), torch.sigmoid(z[3])), strict=True))


def moved(
    case: Case,
    topology: Topology,
    stiffness: TensorLike,
    grip: TensorLike,
    values: Mapping[str, TensorLike],
    frames: int,
) -> Float[Tensor, "f N 3"]:
    """Where the observed points are [m] in the first `frames` frames, on the graph of what is given.

    Raises:
        SimulationDiverged: a state is not finite.
    """
    simulator = topology_simulator(
        topology,
        case.observation,
        stiffness=stiffness,
        controller_stiffness=grip,
        dashpot_damping=values["dashpot_damping"],
        drag_rate=values["drag_rate"],
        friction=values["friction"],
        restitution=values["restitution"],
    )
    points = roll(replace(case, topology=topology), simulator, frames, checkpoint=True)
    return observed(case.anchors, points)


def believed(case: Case, mechanics: Mechanics) -> PartBelief:
    """Of each part, the median of ln E over the springs inside it, E the modulus that a spring means.

    A fit per spring says nothing of how sure it is. A part without springs of its own is believed to be as
    the object is as a whole.
    """
    topology = mechanics.topology
    volume = volumes(case.topology, case.priors)
    unit = lattice_stiffness(topology, np.ones(len(volume)), volume, case.shape_class)
    logs = np.log(np.maximum(mechanics.stiffness, 1e-12) / np.maximum(unit, 1e-300))
    ends = topology.part[topology.springs]
    inside = ends[:, 0] == ends[:, 1]
    own = [logs[inside & (ends[:, 0] == part)] for part in range(len(volume))]
    return PartBelief(np.array([float(np.median(each if len(each) else logs)) for each in own]))


@dataclass(frozen=True)
class Rewired:
    """A twin on springs of its own, which it takes along to other interactions of the object."""

    mechanics: Mechanics
    """Of the case that was fitted."""
    grips: int
    grip_reach: float
    """How controllers hold on; see `hold`."""
    part_belief: PartBelief | None
    parameters: Parameters | None = None
    """None: the springs are not those of the case."""

    def predict(self, case: Case) -> Float32[Array, "T N 3"]:
        """Replay the case on these springs, gripped as it is gripped there."""
        return replay(*self._on_these(case))

    def simulator(self, case: Case) -> Simulator:
        """Of the case on these springs."""
        return case_simulator(*self._on_these(case))

    def _on_these(self, case: Case) -> tuple[Case, Parameters]:
        own = self.mechanics.topology
        topology = hold(with_springs(case.topology, own.springs), self.grips, self.grip_reach)
        return replace(case, topology=topology), carried(self.mechanics.parameters(), own, topology)
