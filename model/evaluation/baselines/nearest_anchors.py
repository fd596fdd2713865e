"""A fit per scene in Spring-Gaus's manner: a stiffness per point, springs to its nearest neighbours."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import torch
from jaxtyping import Float, Float32, Float64, Int
from scipy.spatial import cKDTree
from torch import Tensor

from model.evaluation.baselines.base import Method, PartBelief
from model.evaluation.baselines.gradient import Free, descend
from model.evaluation.baselines.hardening import HardeningSpring
from model.evaluation.baselines.mechanics import (
    Mechanics,
    grip_stiffness,
    prior_globals,
    prior_modulus,
    unit_stiffness,
)
from model.evaluation.baselines.refine import SOFTEST, room
from model.evaluation.baselines.seen import Seen
from model.evaluation.baselines.wiring import with_springs
from model.predictor.lattice import lattice_stiffness
from model.predictor.prior_means import GRIP, volumes
from model.scenes.case import Case
from model.scenes.replay import observed, roll, topology_simulator
from model.simulator.divergence import SimulationDiverged
from model.simulator.simulator import Simulator
from model.types import Array, Parameters, Topology

START = math.log(50.0)
"""How far the one stiffness that the fit begins with may be from the prior's, in ln, either way."""
FIXED = 1.0 / 16.0
"""Share of a point's neighbours, the nearest, whose springs are never faded out; 16 of 256 there."""


class Neighbours:
    """Each point's springs to its nearest points, as undirected springs.

    A point's own list says how much of its stiffness goes into a spring; a spring has the mean of what its
    two ends give, nothing from an end that does not list it, so that forces are equal and opposite (there,
    each point feels the springs of its own list alone, and momentum is not kept).
    """

    def __init__(self, topology: Topology, count: int) -> None:
        """Of every mass point, `count` neighbours."""
        points = topology.points.astype(np.float64)
        wanted = min(count + 1, len(points))
        index = cKDTree(points).query(points, wanted)[1]
        first = np.repeat(np.arange(len(points)), wanted)
        rank = np.tile(np.arange(wanted) - 1, len(points))
        apart = first != index.ravel()
        pairs = np.stack([first, index.ravel()], axis=1)[apart]
        springs, spring = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
        self.topology = with_springs(topology, springs)
        self._owner, self._spring = torch.as_tensor(pairs[:, 0]), torch.as_tensor(spring.ravel())
        fixed = max(1, round(FIXED * (wanted - 1)))
        share = (np.maximum(rank[apart], 0) - fixed) / max(1, wanted - 1 - fixed)
        self._far = torch.as_tensor(np.clip(share, 0.0, 1.0).astype(np.float32))
        self._length = torch.as_tensor(self.topology.rest_length).clamp_min(1e-6)

    def stiffness(self, point: Float[Tensor, " P"], softness: Float[Tensor, ""]) -> Float[Tensor, " E"]:
        """Of every spring [N/m], from those of points [N]; far neighbours count the less the softer."""
        fade = (2.0 - (torch.nn.functional.softplus(softness) * self._far).exp()).clamp(0.0, 1.0)
        given = 0.5 * point[self._owner] * fade
        total = torch.zeros(len(self._length), dtype=given.dtype).index_add(0, self._spring, given)
        return total / self._length


@dataclass(frozen=True)
class NearestAnchors(Method):
    """Spring-Gaus's manner, with our points, our simulator and our tracks.

    Every mass point has a stiffness and springs to its nearest neighbours, whatever lies between; springs
    harden with strain, fade with the rank of the neighbour as fast as is learned, and are damped along their
    axis, each in inverse proportion to its length. Fitted by Adam through the rollout: the stiffness of every
    point, how springs fade, damping, friction. There is no drag and no bounce. What is one constant for each
    object there, set by hand, is chosen here from a row of values by the loss.

    Against the paper: 32 neighbours of a few hundred points rather than 256 of 2048; springs are equal and
    opposite; 60 gradients rather than some hundreds; tracks rather than images are fitted, which spares it
    the estimate of where points are. Controllers, which it has not, hold as much firmer than springs as is
    learned. Other interactions are replayed with the springs found.

    Reference:
        Zhong, Yu, Wu and Li (2024), Reconstruction and simulation of elastic objects with spring-mass 3D
        Gaussians, ECCV, arXiv:2403.09434, and its public code.
    """

    name: ClassVar[str] = "nearest-anchors"

    neighbours: int = 32
    """Springs that each point has in its list."""
    starts: int = 9
    """Values of the one stiffness to begin with that are tried."""
    steps: int = 60
    """Gradients; 0: none."""
    rate: float = 0.05
    """Of Adam, in ln."""

    def fit(self, case: Case) -> "Anchored":
        """Fit the frames before the split.

        Raises:
            InputError: nothing is seen of the motion.
            SimulationDiverged: no start gives a finite rollout.
        """
        seen, neighbours = Seen.of(case), Neighbours(case.topology, self.neighbours)
        begin, point = self._begin(case, seen, neighbours)
        factor = torch.zeros(len(point), requires_grad=True)
        softness = torch.zeros((), requires_grad=True)
        values = ("damping", "friction", "firmness")
        z = torch.tensor([math.log(getattr(begin, name)) for name in values], requires_grad=True)

        def made() -> dict[str, Tensor]:
            stiffness = neighbours.stiffness(point * factor.exp(), softness)
            return {"stiffness": stiffness, **dict(zip(values, z.exp(), strict=True))}

        def loss() -> Tensor:
            return seen.loss(_roll(case, neighbours.topology, made(), len(seen)))

        stiffest = room(_mechanics(begin))
        free = [
            Free([factor], self.rate, SOFTEST, stiffest),
            Free([softness], self.rate),
            Free([z], self.rate),
        ]
        descend(loss, free, self.steps)
        with torch.no_grad():
            found = made()
        damping, friction, firmness = (float(found[name]) for name in values)
        stiffness = found["stiffness"].double().numpy()
        ended = Anchored(neighbours.topology, stiffness, damping, friction, firmness)
        return replace(ended, part_belief=_believed(case, ended))

    def _begin(
        self, case: Case, seen: Seen, neighbours: Neighbours
    ) -> tuple["Anchored", Float[Tensor, " P"]]:
        """The best of the starts, and the stiffness of its points [N]."""
        topology, prior = neighbours.topology, prior_globals(case)
        length = float(np.median(topology.rest_length))
        # of Y/L, the Y: the same for all springs of an object of one modulus
        tension = float((unit_stiffness(case, topology) * topology.rest_length).mean()) * prior_modulus(case)
        best: tuple[float, Anchored, Tensor] | None = None
        last: SimulationDiverged | None = None
        for scale in np.exp(np.linspace(-START, START, self.starts)):
            point = torch.full((len(topology.points),), tension * float(scale))
            stiffness = neighbours.stiffness(point, torch.zeros(())).double().numpy()
            damping = prior["dashpot_damping"] * math.sqrt(scale) * length
            start = Anchored(topology, stiffness, damping, prior["friction"], GRIP)
            kept = _mechanics(start).limited()
            share = float((kept.stiffness / np.maximum(stiffness, 1e-30)).max())
            start = replace(start, stiffness=kept.stiffness, damping=kept.globals["dashpot_damping"] * length)
            try:
                with torch.no_grad():
                    loss = float(seen.loss(_roll(case, topology, start.values, len(seen))))
            except SimulationDiverged as error:
                last = error
                continue
            if best is None or loss < best[0]:
                best = loss, start, point * share
        if best is None:
            assert last is not None
            raise last
        return best[1], best[2]


@dataclass(frozen=True)
class Anchored:
    """A twin with springs to nearest neighbours, which it takes along to other interactions."""

    topology: Topology
    """Of the case that was fitted, on these springs."""
    stiffness: Float64[Array, " E"]
    """[N/m]."""
    damping: float
    """Of a dashpot, times its length [N·s]."""
    friction: float
    firmness: float
    """Controller springs over the springs of the points that they hold."""
    part_belief: PartBelief | None = None
    parameters: Parameters | None = None
    """None: the springs are not those of the case."""

    @property
    def values(self) -> dict[str, Tensor]:
        """What is fitted, as tensors."""
        numbers = {name: torch.tensor(getattr(self, name)) for name in ("damping", "friction", "firmness")}
        return {"stiffness": torch.as_tensor(self.stiffness), **numbers}

    def predict(self, case: Case) -> Float32[Array, "T N 3"]:
        """Replay the case on these springs, gripped as it is gripped there."""
        topology = with_springs(case.topology, self.topology.springs)
        with torch.no_grad():
            points = _roll(case, topology, self.values, len(case.observation.times))
        return points.numpy().astype(np.float32)

    def simulator(self, case: Case) -> Simulator:
        """Of the case on these springs."""
        return _simulator(case, with_springs(case.topology, self.topology.springs), self.values)


def _mechanics(twin: Anchored) -> Mechanics:
    """The twin with one dashpot for all springs, for what bounds the step."""
    length = float(np.median(twin.topology.rest_length))
    values = {"dashpot_damping": twin.damping / length, "drag_rate": 0.0, "friction": 0.0, "restitution": 0.0}
    grip = twin.firmness * grip_stiffness(twin.topology, twin.stiffness)
    return Mechanics(twin.topology, twin.stiffness, grip, values)


def _roll(
    case: Case, topology: Topology, values: Mapping[str, Tensor], frames: int
) -> Float[Tensor, "f N 3"]:
    """Where the observed points are [m], on the graph of `stiffness`, `damping`, `friction`, `firmness`."""
    simulator = _simulator(case, topology, values)
    points = roll(replace(case, topology=topology), simulator, frames, checkpoint=True)
    return observed(case.anchors, points)


def _simulator(case: Case, topology: Topology, values: Mapping[str, Tensor]) -> Simulator:
    stiffness = values["stiffness"].float()
    held = torch.as_tensor(topology.controller_springs[:, 1]).long()
    grip = values["firmness"] * _usual(torch.as_tensor(topology.springs).long(), stiffness, topology)[held]
    lengths = np.concatenate([topology.rest_length, topology.controller_rest_length])
    return topology_simulator(
        topology,
        case.observation,
        stiffness=stiffness,
        controller_stiffness=grip,
        dashpot_damping=values["damping"] / torch.as_tensor(lengths).clamp_min(1e-6),
        friction=values["friction"],
    ).with_force(HardeningSpring(stiffness))


def _usual(
    springs: Int[Tensor, "E 2"], stiffness: Float[Tensor, " E"], topology: Topology
) -> Float[Tensor, " P"]:
    """Mean stiffness of the springs of each point [N/m]."""
    ends, both = springs.reshape(-1), stiffness.repeat_interleave(2)
    count = len(topology.points)
    total = torch.zeros(count, dtype=both.dtype).index_add(0, ends, both)
    return total / torch.bincount(ends, minlength=count).clamp_min(1)


def _believed(case: Case, twin: Anchored) -> PartBelief:
    """Of each part, E such that its springs resist stretching as much: Σ k L² over that of 1 Pa."""
    topology, volume = twin.topology, volumes(case.topology, case.priors)
    unit = lattice_stiffness(topology, np.ones(len(volume)), volume, case.shape_class)
    square = topology.rest_length.astype(np.float64) ** 2
    ends = topology.part[topology.springs]
    inside = ends[:, 0] == ends[:, 1]
    logs = []
    for part in range(len(volume)):
        own = inside & (ends[:, 0] == part)
        own = own if own.any() else np.ones_like(own)
        logs.append(math.log((twin.stiffness * square)[own].sum() / (unit * square)[own].sum()))
    return PartBelief(np.array(logs))
