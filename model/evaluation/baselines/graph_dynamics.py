"""Dynamics learned per scene in GS-Dynamics's manner: a network over particles, no springs."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from jaxtyping import Float, Float32, Int
from torch import Tensor

from model.evaluation.baselines.base import Method, PartBelief
from model.evaluation.baselines.message_passing import MessagePassing
from model.evaluation.baselines.particles import Particles, choose, followed, graph
from model.evaluation.baselines.seen import Seen
from model.scenes.case import Case
from model.scenes.replay import observed
from model.types import Array, Parameters

HISTORY = 3
"""Frames that the network sees."""
NODE = 2 + 3 * (HISTORY - 1) + 3 + 1
"""Features of a particle: its kind, how it moved, how it will move if it is held, how high it is."""
EDGE = 3 * HISTORY + 2
"""Features of a pair: where the sender was seen from the receiver, the rest length, the strain."""
LENGTHS = 0.1
"""Weight of the loss of lengths beside that of places."""
STRAIN = 10.0
"""What the strain is shown times, so that a tenth of it is as large to the network as the other features."""
FASTER = 3.0
"""How much faster than all that is known something may go: a cloth's end whips at twice a hand's speed."""
HIGHEST = 5.0
"""Heights above ground count up to so many spacings."""


@dataclass(frozen=True)
class Scales:
    """Units of the network's features."""

    length: float
    """[m]."""
    step: float
    """From frame to frame [m]."""


class Dynamics(torch.nn.Module):
    """Where particles are in the next frame: they go on as they went, and a network says how else."""

    def __init__(self, scales: Scales, width: int, passes: int, seed: int) -> None:
        """Untrained: particles go on as they went."""
        super().__init__()
        self._scales = scales
        self.network = MessagePassing(NODE, EDGE, width=width, passes=passes, seed=seed)

    def forward(
        self, particles: Particles, history: Float[Tensor, "b h n 3"], after: Float[Tensor, "b c 3"]
    ) -> Float[Tensor, "b n 3"]:
        """Particles and controllers in the next frame [m].

        Args:
            particles: The graph.
            history: Where they were in the last frames, the present one last [m].
            after: Where the controllers will be [m].
        """
        length, step = self._scales.length, self._scales.step
        now, count = history[:, -1], particles.count
        kind = torch.zeros((*now.shape[:2], 2))
        kind[:, :count, 0], kind[:, count:, 1] = 1.0, 1.0
        went = (history[:, 1:] - history[:, :-1]) / step
        will = torch.cat([torch.zeros_like(now[:, :count]), (after - now[:, count:]) / step], dim=1)
        if particles.ground is None:
            height = torch.full_like(now[..., :1], HIGHEST)
        else:
            height = ((now[..., 2:] - particles.ground) / length).clamp(-1.0, HIGHEST)
        nodes = torch.cat([kind, went.transpose(1, 2).flatten(2), will, height], dim=-1)
        sender, receiver = particles.pairs.T
        offset = (history[:, :, sender] - history[:, :, receiver]) / length
        rest = torch.linalg.vector_norm(particles.rest[sender] - particles.rest[receiver], dim=-1) / length
        strain = STRAIN * (torch.linalg.vector_norm(offset[:, -1], dim=-1) / rest - 1.0)
        shape = torch.stack([rest.expand_as(strain), strain], dim=-1)
        edges = torch.cat([offset.transpose(1, 2).flatten(2), shape], dim=-1)
        push = self.network(nodes, edges, particles.pairs)[:, :count] * step
        free = now[:, :count] + (now[:, :count] - history[:, -2, :count]) + push
        return torch.cat([free, after], dim=1)

    def rollout(
        self,
        particles: Particles,
        history: Float[Tensor, "b h n 3"],
        controls: Float[Tensor, "b t c 3"],
        farthest: float = math.inf,
    ) -> Float[Tensor, "b t n 3"]:
        """The frames after `history` [m], as many as there are controls.

        Args:
            particles: The graph.
            history: Where they were in the last frames [m].
            controls: Where the controllers will be [m].
            farthest: That a particle may go from frame to frame [m].
        """
        made = []
        for frame in range(controls.shape[1]):
            after = self(particles, history, controls[:, frame])
            after = _slowed(history[:, -1], after, particles.count, farthest)
            history = torch.cat([history[:, 1:], after.unsqueeze(1)], dim=1)
            made.append(after)
        return torch.stack(made, dim=1)


@dataclass(frozen=True)
class GraphDynamics(Method):
    """GS-Dynamics' manner, with our tracks: particles, controllers as particles, messages between neighbours.

    A network sees where particles were in three frames, relative to their neighbours, and how the controllers
    will move, and says where the particles will be; it is trained to be right over five frames in a row, from
    histories with noise, turned about the vertical at random, with the mean square error and a tenth of that
    of lengths between neighbours. It knows no physics but that what moves goes on moving.

    The seen frames are predicted from frame 0, the future from the last frames seen, other interactions from
    rest. Particles are some of the mass points, which follow the points that were seen around them. None goes
    more than three times as fast as anything seen, the hands, or what falls from as high as the object
    reaches at first (without a ground: for as long as the clip lasts). The paper's code allows 100 m a frame.

    Against the paper: one clip to learn from rather than dozens; 64 wide rather than 512; 800 steps of 8
    windows rather than 100 000 of 16. Neighbours are those at rest, not those of the moment, since what is
    held here stays held; rest length, strain and height above the ground are shown to the network besides.

    Reference:
        Zhang et al. (2024), Dynamic 3D Gaussian tracking for graph-based neural dynamics modeling, CoRL,
        arXiv:2410.18912, and its public code.
    """

    name: ClassVar[str] = "graph-dynamics"
    version: ClassVar[str] = "4"

    particles: int = 100
    """At most."""
    neighbours: int = 5
    """That each particle is joined to, and each controller."""
    width: int = 64
    passes: int = 3
    """Rounds of messages."""
    future: int = 5
    """Frames in a row that a step is trained on."""
    steps: int = 800
    batch: int = 8
    """Windows per step."""
    rate: float = 2e-3
    """Of Adam; it falls off as a cosine."""
    noise: float = 0.05
    """Of histories, uniform within so many spacings."""
    seed: int = 42

    def fit(self, case: Case) -> "Learned":
        """Train on the frames before the split.

        Raises:
            InputError: nothing is seen of the motion.
        """
        Seen.of(case)
        chosen = choose(case, self.particles)
        particles = graph(case, chosen, self.neighbours)
        tracks = self._tracks(case, particles)
        moved = torch.linalg.vector_norm(tracks[1:] - tracks[:-1], dim=-1)
        scales = Scales(particles.spacing, max(float(moved.square().mean().sqrt()), 1e-5))
        dynamics = Dynamics(scales, self.width, self.passes, self.seed)
        self._train(dynamics, particles, tracks, scales)
        last = tracks[_before(case.split, len(tracks))]
        fastest = float(moved.max()) / _interval(case)
        return Learned(case.name, dynamics, chosen, self.neighbours, case.split, last, fastest)

    @staticmethod
    def _tracks(case: Case, particles: Particles) -> Float[Tensor, "F n 3"]:
        free = followed(case, particles.rest[: particles.count].numpy())
        return torch.cat(
            [torch.as_tensor(free), torch.as_tensor(case.observation.controllers[: case.split])], dim=1
        )

    def _train(
        self, dynamics: Dynamics, particles: Particles, tracks: Float[Tensor, "F n 3"], scales: Scales
    ) -> None:
        random = torch.Generator().manual_seed(self.seed)
        optimiser = torch.optim.Adam(dynamics.parameters(), lr=self.rate)
        future = min(self.future, len(tracks) - 1)
        for number in range(self.steps):
            optimiser.param_groups[0]["lr"] = self.rate * max(
                0.5 * (1.0 + math.cos(math.pi * number / self.steps)), 0.02
            )
            present = torch.randint(0, len(tracks) - future, (self.batch,), generator=random)
            history, wanted = _windows(tracks, present, future)
            turn = _turns(self.batch, random)
            history, wanted = history @ turn[:, None], wanted @ turn[:, None]
            jitter = 2.0 * torch.rand(history.shape, generator=random) - 1.0
            jitter[:, :, particles.count :] = 0.0
            history = history + self.noise * scales.length * jitter
            made = dynamics.rollout(particles, history, wanted[:, :, particles.count :])
            loss = _loss(particles, made, wanted) / scales.step**2
            optimiser.zero_grad()
            torch.autograd.backward(loss)
            torch.nn.utils.clip_grad_norm_(dynamics.parameters(), 1.0)
            optimiser.step()


@dataclass(frozen=True)
class Learned:
    """A network that has learned how one object moves."""

    case: str
    """Of which case."""
    dynamics: Dynamics
    chosen: Int[Array, " n"]
    """The mass points that are particles."""
    neighbours: int
    split: int
    last: Float[Tensor, "h m 3"]
    """Particles and controllers in the last frames of `case` that were seen [m]."""
    fastest: float
    """That any of them was seen to be [m/s]."""
    parameters: Parameters | None = None
    part_belief: PartBelief | None = None

    def predict(self, case: Case) -> Float32[Array, "T N 3"]:
        """From rest, and from the split of the case that was fitted on from where it was last seen [m]."""
        particles = graph(case, self.chosen, self.neighbours)
        controls = torch.as_tensor(case.observation.controllers)
        still = particles.rest.repeat(HISTORY, 1, 1)
        known = max(max(self.fastest, _falling(case)) * _interval(case), _farthest(controls))
        farthest = FASTER * known
        if case.name == self.case:
            made = torch.cat(
                [
                    self._roll(particles, still, controls[1 : self.split], farthest),
                    self._roll(particles, self.last, controls[self.split :], farthest),
                ]
            )
        else:
            made = self._roll(particles, still, controls[1:], farthest)
        free = torch.cat([particles.rest[None], made])[:, : particles.count]
        return observed(particles.anchors, free).numpy().astype(np.float32)

    def _roll(
        self,
        particles: Particles,
        history: Float[Tensor, "h n 3"],
        controls: Float[Tensor, "t c 3"],
        farthest: float,
    ) -> Float[Tensor, "t n 3"]:
        if not len(controls):
            return history[:0]
        with torch.no_grad():
            return self.dynamics.rollout(particles, history[None], controls[None], farthest)[0]


def _slowed(
    now: Float[Tensor, "b n 3"], after: Float[Tensor, "b n 3"], count: int, farthest: float
) -> Float[Tensor, "b n 3"]:
    """The next frame, in which no particle has gone farther than that; controllers go where they go."""
    if math.isinf(farthest):
        return after
    way = after[:, :count] - now[:, :count]
    length = torch.linalg.vector_norm(way, dim=-1, keepdim=True)
    free = now[:, :count] + way * (farthest / length.clamp_min(1e-12)).clamp(max=1.0)
    return torch.cat([free, after[:, count:]], dim=1)


def _farthest(tracks: Float[Tensor, "t n 3"]) -> float:
    """That anything goes from frame to frame [m]."""
    if len(tracks) < 2 or not tracks.shape[1]:
        return 0.0
    return float(torch.linalg.vector_norm(tracks[1:] - tracks[:-1], dim=-1).max())


def _falling(case: Case) -> float:
    """How fast what falls from the object's highest point is at the ground, or at the clip's end [m/s]."""
    seen = case.observation
    weight = float(np.linalg.norm(seen.gravity))
    if seen.ground_height is None:
        return weight * float(seen.times[-1] - seen.times[0])
    return math.sqrt(2.0 * weight * max(float(np.nanmax(case.rest[:, 2])) - seen.ground_height, 0.0))


def _interval(case: Case) -> float:
    """Usual time from frame to frame [s]."""
    return float(np.median(np.diff(case.observation.times)))


def _before(frame: int, frames: int) -> Int[Tensor, " h"]:
    """The frames that the network sees before `frame`; frame 0 stands for what came before it."""
    return torch.arange(frame - HISTORY, frame).clamp(0, frames - 1)


def _windows(
    tracks: Float[Tensor, "F n 3"], present: Int[Tensor, " b"], future: int
) -> tuple[Float[Tensor, "b h n 3"], Float[Tensor, "b t n 3"]]:
    """What is seen in the present frames, and what comes after."""
    back = torch.arange(1 - HISTORY, 1)
    history = tracks[(present[:, None] + back).clamp_min(0)]
    return history, tracks[present[:, None] + torch.arange(1, future + 1)]


def _turns(count: int, random: torch.Generator) -> Float[Tensor, "b 3 3"]:
    """Rotations about the vertical."""
    angle = 2.0 * math.pi * torch.rand(count, generator=random)
    turn = torch.zeros((count, 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = angle.cos()
    turn[:, 0, 1], turn[:, 1, 0] = angle.sin(), -angle.sin()
    turn[:, 2, 2] = 1.0
    return turn


def _loss(
    particles: Particles, made: Float[Tensor, "b t n 3"], wanted: Float[Tensor, "b t n 3"]
) -> Float[Tensor, ""]:
    """Mean square of coordinates and, for a tenth, of lengths between neighbours [m²]."""
    free = made[:, :, : particles.count] - wanted[:, :, : particles.count]
    sender, receiver = particles.pairs.T
    lengths = [torch.linalg.vector_norm(x[:, :, sender] - x[:, :, receiver], dim=-1) for x in (made, wanted)]
    loss: Tensor = free.square().mean() + LENGTHS * (lengths[0] - lengths[1]).square().mean()
    return loss
