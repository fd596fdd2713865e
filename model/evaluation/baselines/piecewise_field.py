"""A fit per scene in NeuSpring's manner: springs searched piece by piece, stiffness as a neural field."""

from dataclasses import dataclass
from typing import ClassVar

import torch

from model.evaluation.baselines.base import Method
from model.evaluation.baselines.coarse import search
from model.evaluation.baselines.gradient import Free
from model.evaluation.baselines.mechanics import Mechanics, Rewired, believed
from model.evaluation.baselines.refine import SOFTEST, refine, room
from model.evaluation.baselines.seen import Seen
from model.evaluation.baselines.stiffness_field import StiffnessField, unit_cube
from model.scenes.case import Case


@dataclass(frozen=True)
class PiecewiseField(Method):
    """NeuSpring's manner, with our springs, our simulator and our tracks.

    Stage one, without gradients: as in `TwoStage`, but every piece of the object has its own number and reach
    of springs. Stage two, by Adam through the rollout: a field over the rest shape (three planes of features
    and a small network) says how stiff a spring is by where its middle lies; controller springs and globals
    are fitted along. The loss is track + Chamfer, equally.

    Against the paper: pieces are the case's parts, there regions of the points; its code is not public at
    the time of writing, so sizes and rates of the field are ours. 60 gradients of the whole clip rather than
    hundreds of epochs. No appearance is optimised. Other interactions are replayed with the springs found.

    Reference:
        Xu et al. (2025), NeuSpring: Neural spring fields for reconstruction and simulation of deformable
        objects from videos, arXiv:2511.08310.
    """

    name: ClassVar[str] = "piecewise-field"

    generations: int = 20
    """Of CMA-ES; 0: none."""
    population: int | None = None
    """Rollouts per generation; None: 4 + 3 ln of how many numbers are searched (11 for two pieces)."""
    steps: int = 60
    """Gradients in stage two; 0: none."""
    rate: float = 0.05
    """Of Adam, of controller springs and globals, in ln."""
    field_rate: float = 0.01
    """Of Adam, of the field's weights."""
    seed: int = 42

    def fit(self, case: Case) -> Rewired:
        """Both stages, on the frames before the split.

        Raises:
            InputError: nothing is seen of the motion.
        """
        seen = Seen.of(case)
        coarse = search(
            case,
            seen,
            case.topology.part.astype(int),
            generations=self.generations,
            population=self.population,
            seed=self.seed,
        )
        mechanics = self._refine(case, seen, coarse.mechanics) if self.steps else coarse.mechanics
        wiring = coarse.wiring
        return Rewired(mechanics, wiring.grips, wiring.grip_reach, believed(case, mechanics))

    def _refine(self, case: Case, seen: Seen, begin: Mechanics) -> Mechanics:
        topology = begin.topology
        body = torch.as_tensor(topology.points)
        middles = unit_cube(body[torch.as_tensor(topology.springs).long()].mean(1), body)
        field = StiffnessField(SOFTEST, max(room(begin), 1e-3), seed=self.seed)
        free = [Free(list(field.parameters()), self.field_rate)]
        return refine(case, seen, begin, lambda: field(middles), free, rate=self.rate, steps=self.steps)
