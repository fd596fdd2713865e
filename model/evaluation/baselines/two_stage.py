"""A fit per scene in PhysTwin's manner: globals and springs by CMA-ES, then every spring by gradients."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch

from model.evaluation.baselines.base import Method
from model.evaluation.baselines.coarse import search
from model.evaluation.baselines.gradient import Free
from model.evaluation.baselines.mechanics import Rewired, believed
from model.evaluation.baselines.refine import SOFTEST, refine, room
from model.evaluation.baselines.seen import Seen
from model.scenes.case import Case


@dataclass(frozen=True)
class TwoStage(Method):
    """PhysTwin's manner, with our springs, our simulator and our tracks.

    Stage one, without gradients: one modulus (k = Y/L), dashpot, drag, friction, restitution, the stiffness
    of the grip, how many springs a point asks for, how long they may be, and the same of controllers, by
    CMA-ES with a first step of 1/6 of each range. Stage two, by Adam through the rollout: every spring, every
    controller spring, and friction, restitution, dashpot and drag. The loss is track + Chamfer, equally.

    Against the paper: as many generations (20); 60 steps along the gradient of the whole clip rather than 200
    epochs of a step per frame, their rate so much larger that a spring may go as far; the gradient is that of
    the whole rollout, there of single frames. The search begins at the prior's mean, there at constants. No
    self-contact is searched. Other interactions are replayed with the springs found, gripped anew as hard.

    Reference:
        Jiang et al. (2025), PhysTwin: Physics-informed reconstruction and simulation of deformable objects
        from videos, arXiv:2503.17973, and its public code.
    """

    name: ClassVar[str] = "two-stage"

    generations: int = 20
    """Of CMA-ES; 0: none."""
    population: int | None = None
    """Rollouts per generation; None: 4 + 3 ln of how many numbers are searched (10)."""
    steps: int = 60
    """Gradients in stage two; 0: none."""
    rate: float = 0.05
    """Of Adam, in ln of stiffness."""
    seed: int = 42

    def fit(self, case: Case) -> Rewired:
        """Both stages, on the frames before the split.

        Raises:
            InputError: nothing is seen of the motion.
        """
        seen = Seen.of(case)
        region = np.zeros(len(case.topology.points), np.int64)
        coarse = search(
            case, seen, region, generations=self.generations, population=self.population, seed=self.seed
        )
        mechanics, wiring = coarse.mechanics, coarse.wiring
        if self.steps:
            springs = torch.zeros(len(mechanics.stiffness), requires_grad=True)
            free = [Free([springs], self.rate, SOFTEST, room(mechanics))]
            mechanics = refine(case, seen, mechanics, lambda: springs, free, rate=self.rate, steps=self.steps)
        return Rewired(mechanics, wiring.grips, wiring.grip_reach, believed(case, mechanics))
