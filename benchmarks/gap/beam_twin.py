"""The twin of a beam in other recordings of it, and with a load at its end."""

from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Float64
from scipy.optimize import minimize_scalar

from benchmarks.gap.swing import LOOKED_AT
from model.gap.bodies.body import between, grip_of
from model.gap.bodies.rest import rest_places
from model.gap.effects.mass_heterogeneity import MassHeterogeneity
from model.gap.plain import PlainTwin
from model.gap.study import Study
from model.types import Array, Observation

HEAVIEST = 0.1
"""Of a load that is looked for, in metres of beam."""
TRIED = 9


def elsewhere(fitted: Study, seen: Observation) -> PlainTwin:
    """The same body in the same clamp, where other markers are seen of it."""
    body = fitted.plain.twin.body
    index, weight = between(rest_places(seen), body.points)
    grip = grip_of(body.points, seen.controllers[0].astype(np.float64), body.grasp)
    return PlainTwin.of(replace(body, index=index, weight=weight, grip=grip), seen)


def foretold(
    fitted: Study, twin: PlainTwin, load: float = 0.0, last: int | None = None
) -> Float64[Array, "T N 3"]:
    """Where a twin expects the points, run open loop from when it is let go [m].

    Args:
        fitted: Whose parameters it has.
        twin: In the recording it was fitted to, or in another.
        load: Added at the free end, in metres of beam.
        last: Frame to end with; None: the last there is.
    """
    hypothesis = replace(fitted.plain, twin=with_load(twin, load))
    world = hypothesis.at({name: fitted.base.values[name] for name in hypothesis.quantities})
    with torch.no_grad():
        seen: Float64[Array, "T N 3"] = world.sight(world.rollout(last=last).points).double().numpy()
    return seen


def with_load(twin: PlainTwin, load: float) -> PlainTwin:
    """A twin with a load on the mass points of its free end.

    Args:
        twin: Of a beam.
        load: As heavy as so much of the beam [m]: twins know of masses by their ratios alone.
    """
    along = lengthwise(twin)
    end = along > along.max() - 0.3 * twin.body.spacing
    mass = twin.matter.mass + load * per_metre(twin) * end / end.sum()
    return replace(twin, matter=replace(twin.matter, mass=mass))


def lengthwise(twin: PlainTwin) -> Float64[Array, " P"]:
    """How far each mass point of a beam is from its clamp [m]; what is behind it is below zero."""
    hand = twin.observation.controllers[0].astype(np.float64).mean(0)
    points = twin.body.points - hand
    axis = np.linalg.svd(points - points.mean(0), full_matrices=False)[2][0]
    along: Float64[Array, " P"] = points @ axis * np.sign(points.mean(0) @ axis)
    return along


def per_metre(twin: PlainTwin) -> float:
    """Mass of the twin of a beam for each metre [kg/m]."""
    return float(twin.matter.mass.sum() / np.ptp(lengthwise(twin)))


def load_found(fitted: Study, twin: PlainTwin) -> float:
    """The load at the free end with which a twin foretells a recording best, its own parameters kept.

    Returns:
        In metres of beam.
    """
    seen = twin.observation.points.astype(np.float64)
    early = slice(0, int(np.searchsorted(twin.observation.times, twin.observation.times[0] + LOOKED_AT)))

    def left(load: float) -> float:
        return float(np.nanmean((foretold(fitted, twin, load, early.stop - 1) - seen[early]) ** 2))

    tried = np.linspace(0.0, HEAVIEST, TRIED)
    best = int(np.argmin([left(float(load)) for load in tried]))
    around = tried[max(best - 1, 0)], tried[min(best + 1, TRIED - 1)]
    return float(minimize_scalar(left, bounds=around, method="bounded", options={"maxiter": 8}).x)


def added(twin: PlainTwin, values: dict[str, float]) -> tuple[float, float]:
    """What a load of these values adds.

    Returns:
        The load in metres of beam; how far from the clamp its middle is, over the length.
    """
    effect = MassHeterogeneity()
    own = {name: torch.tensor(values[f"{effect.name}.{name}"]) for name in effect.quantities}
    start = {name: torch.tensor(quantity.start).double() for name, quantity in twin.quantities.items()}
    bare = twin.world(start)
    more = (effect.apply(bare, own).system.value("mass") - bare.system.value("mass")).double().numpy()
    along = lengthwise(twin)
    return float(more.sum()) / per_metre(twin), float(more @ along / more.sum() / along.max())
