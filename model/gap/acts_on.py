"""How strongly an effect acts on each point of the object."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64
from scipy.special import softmax
from torch import Tensor

from model.gap.belief import LOOSE
from model.gap.coordinates import Coordinates
from model.gap.effects.base import Effect, Field, Quantity
from model.gap.effects.self_collision import SelfContact
from model.gap.estimate import Estimate
from model.gap.fields import Place, everywhere, first_places_of, near_places_of, rescaled, tensor
from model.gap.hypothesis import Hypothesis
from model.gap.study import Study
from model.gap.world import World
from model.simulator.divergence import SimulationDiverged
from model.types import Array

BLOCKS = 5
"""Of time: what is fitted on four of them has to explain the fifth."""
MOST = 4.0
"""An effect in a place is at most so much stronger than where it acts on all alike."""
LEAST = 0.1
"""A place has to leave less than `everywhere` by this share, in the geometric mean of all blocks."""
WINS = 3
"""Of the blocks in which it has to leave less, at least."""
EFFECTIVE = 20.0
"""Independent numbers that a held-out block is taken for, where places are weighed against each other."""
ALL_ALIKE = 0.5
"""How likely an effect is to act on all alike, before anything was seen; places are alike likely."""
TOUCH, MEET = 0.3, 0.1
"""Time [s] on the ground, or near another part, from which an effect of contact acts fully."""
GROUND_REACH = 0.3
"""Height above the ground, in spacings, at which a mass point still touches it."""


@dataclass(frozen=True)
class Acting:
    """Where an effect acts."""

    field: Float64[Array, " P"]
    """How strongly on each mass point, 0..1, as a report shows it."""
    points: Float64[Array, " N"]
    """On each observed point, 0..1, 1 at most and somewhere."""
    local: bool
    """It acts in a part of the body only."""
    where: Field | None
    """What a fit of the effect takes (`Hypothesis.where`); None: it acts by itself, or on all alike."""
    scale: float = 1.0
    """About how much stronger it is there than where it acts on all alike."""


def acting(study: Study, estimate: Estimate, effect: Effect, where: Field | None = None) -> Acting:
    """Where a fitted effect acts.

    An effect of grip, hand, ground or surroundings, and a load, acts where its law says. One of the material
    may act in a part of the body. Places are tried - one side of a cut, a patch, and neighbours of the best -
    each by rollouts at two amplitudes. What is between these, with all parameters free to follow linearly, is
    fitted to four blocks of time and judged on the fifth. The field is what is expected of all these places,
    weighed by how well they foretell. A fit takes it only where some place is better than everywhere by a
    margin; else it is slight, and says where the effect acts if it does not act on all alike.

    Args:
        study: The plain twin, fitted.
        estimate: The plain twin with this effect, fitted to the same frames.
        effect: What was fitted.
        where: The place where it was fitted, which it keeps; None: on all alike.
    """
    world = study.plain.with_effect(effect).at(estimate.values)
    if where is not None:
        return _acting(world, where.double().numpy(), where)
    natural = _natural(study, world, estimate, effect)
    if natural is not None:
        return _acting(world, natural, None)
    points = study.plain.twin.body.points
    judge = _Judge(study, estimate, effect)
    tried = [everywhere(points), *first_places_of(points)]
    verdicts = judge(tried)
    best = min(range(len(tried)), key=lambda i: verdicts[i].loss)
    more = near_places_of(points, tried[best])
    tried, verdicts = [*tried, *more], [*verdicts, *judge(more)]
    best = min(range(len(tried)), key=lambda i: verdicts[i].loss)
    field = _expected(tried, verdicts)
    wins = int((verdicts[best].losses < verdicts[0].losses).sum())
    if verdicts[0].loss - verdicts[best].loss < LEAST or wins < WINS:
        return _acting(world, field, None)
    return _acting(world, field, tensor(field), verdicts[best].scale)


@dataclass(frozen=True, kw_only=True)
class Somewhere(Hypothesis):
    """An effect at fixed values, as a function of its place and of how much stronger it is there."""

    fields: tuple[Field, ...]

    @property
    def quantities(self) -> dict[str, Quantity]:
        """The index of a place, and a factor of the effect's amplitude."""
        last = float(len(self.fields))
        return {"place": Quantity("1", (-1.0, last), 0.0), "scale": Quantity("1", (0.1, MOST), 1.0, log=True)}

    @property
    def together(self) -> bool:
        """Fields are not batched."""
        return False

    def __call__(self, values: Mapping[str, Tensor]) -> World:
        """The world of the place with this index."""
        index, scale = round(float(values["place"])), float(values["scale"])
        held = dict(self.held or {})
        for effect in self.effects:
            for name in effect.absent:
                low, high = effect.quantities[name].bounds
                key = f"{effect.name}.{name}"
                held[key] = float(np.clip(scale * held[key], low, high))
        return Hypothesis(self.twin, self.effects, None, self.fields[index]).at(held)


@dataclass(frozen=True)
class _Verdict:
    losses: Float64[Array, " b"]
    """Squares left in each block of time, fitted to the others."""
    scale: float

    @property
    def loss(self) -> float:
        """Mean logarithm: long after the start predictions are worse, for all places alike."""
        return float(np.log(np.maximum(self.losses, 1e-12)).mean())


class _Judge:
    """Tries places, all in the same time steps."""

    def __init__(self, study: Study, estimate: Estimate, effect: Effect) -> None:
        plain = study.plain.twin
        self._like = Somewhere(plain, (effect,), estimate.values, fields=())
        self._misfit = study.misfit.of(replace(self._like, fields=(tensor(np.ones(len(plain.body.points))),)))
        self._at(0, MOST)
        self._slopes = estimate.jacobian
        self._blocks = BLOCKS * study.frame_of_residuals() // study.split

    def __call__(self, tried: Sequence[Place]) -> list[_Verdict]:
        self._misfit.hypothesis = replace(self._like, fields=tuple(tensor(place.field) for place in tried))
        self._misfit.coordinates = Coordinates(self._misfit.hypothesis.quantities)
        return [self._judged(i, place) for i, place in enumerate(tried)]

    def _at(self, index: int, scale: float) -> Float64[Array, " m"]:
        vector = self._misfit.coordinates.vector({"place": float(index), "scale": scale})
        left: Float64[Array, " m"] = self._misfit(vector[None])[0]
        return left

    def _judged(self, index: int, place: Place) -> _Verdict:
        """Between the amplitude that was fitted and the one with which as much acts in the place."""
        scale = float(np.clip(1.0 / place.field.mean(), 1.5, MOST))
        low, high = self._at(index, 1.0), self._at(index, scale)
        columns = np.concatenate([self._slopes, (high - low)[:, None]], 1)
        prior = np.diag([*np.full(self._slopes.shape[1], LOOSE**-2), 1.0])
        grams = [columns[self._blocks == b].T @ columns[self._blocks == b] for b in range(BLOCKS)]
        rights = [columns[self._blocks == b].T @ low[self._blocks == b] for b in range(BLOCKS)]
        losses = []
        for b in range(BLOCKS):
            size = _sizes(sum(grams) - grams[b] + prior, sum(rights) - rights[b])
            here = self._blocks == b
            losses.append(float(((low[here] + columns[here] @ size) ** 2).sum()))
        share = float(_sizes(sum(grams) + prior, sum(rights))[-1])
        return _Verdict(np.array(losses), 1.0 + share * (scale - 1.0))


def _expected(tried: Sequence[Place], verdicts: Sequence[_Verdict]) -> Float64[Array, " P"]:
    """How strongly it is expected to act on each mass point, 1 at most; the first place is everywhere."""
    others = len(tried) - 1
    prior = np.array([ALL_ALIKE, *np.full(others, (1.0 - ALL_ALIKE) / others)])
    losses = np.array([verdict.loss for verdict in verdicts])
    weights = softmax(np.log(prior) - 0.5 * EFFECTIVE * BLOCKS * losses)
    return rescaled(weights @ np.stack([place.field for place in tried]))


def _sizes(gram: Float64[Array, "n n"], right: Float64[Array, " n"]) -> Float64[Array, " n"]:
    """What fits best; the amplitude stays where the two rollouts tell of it."""
    sizes: Float64[Array, " n"] = -np.linalg.solve(gram, right)
    amplitude = float(np.clip(sizes[-1], -0.5, 1.5))
    if amplitude == sizes[-1]:
        return sizes
    rest = -np.linalg.solve(gram[:-1, :-1], right[:-1] + amplitude * gram[:-1, -1])
    return np.append(rest, amplitude)


def _acting(world: World, field: Float64[Array, " P"], where: Field | None, scale: float = 1.0) -> Acting:
    seen = world.sight.spread(tensor(field).to(world.sight.weight)).double().numpy()
    return Acting(field, rescaled(seen), where is not None, where, scale)


def _natural(study: Study, world: World, estimate: Estimate, effect: Effect) -> Float64[Array, " P"] | None:
    """Where the law itself says that the effect acts; None: it may act in any part of the body."""
    if effect.acts == "ground":
        ground = world.ground_height
        height = -np.inf if ground is None else ground + GROUND_REACH * world.spacing
        return _lasting(study, world, TOUCH, lambda points: points[..., 2] < height)
    if isinstance(effect, SelfContact):
        distance = estimate.values[f"{effect.name}.distance"] * world.spacing
        return _lasting(study, world, MEET, Meeting(world, distance))
    if effect.acts == "body" and type(effect).strength is Effect.strength:
        return None
    own = {name: torch.tensor(estimate.values[f"{effect.name}.{name}"]) for name in effect.quantities}
    return rescaled(effect.strength(world, own).double().numpy())


@dataclass(frozen=True)
class Meeting:
    """Which mass points are near ones that are not their neighbours."""

    world: World
    distance: float

    def __call__(self, points: Float[Tensor, "T P 3"]) -> Bool[Tensor, "T P"]:
        """At each of these places [m]."""
        rest = self.world.system.points
        far = torch.cdist(rest, rest) > max(2.0 * self.world.spacing, 1.5 * self.distance)
        return torch.stack([((torch.cdist(p, p) < self.distance) & far).any(-1) for p in points])


def _lasting(
    study: Study, world: World, full: float, acts: Callable[[Tensor], Tensor]
) -> Float64[Array, " P"]:
    """How long each mass point is where an effect acts, over the time [s] from which it is fully so."""
    try:
        with torch.no_grad():
            points = study.observer.lead(world).rollout.points
    except SimulationDiverged:
        return np.ones(len(world.system.points))
    each = np.gradient(study.observation.times)
    time = np.where(acts(points).numpy(), each[:, None], 0.0).sum(0)
    return rescaled(np.minimum(time / full, 1.0))
