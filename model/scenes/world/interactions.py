"""What hands do with an object: where they take it and how they move, and how the object lies before."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int
from scipy.spatial.transform import Rotation

from model.scenes.case import Interaction
from model.scenes.world.body import spread
from model.scenes.world.moves import direction, ease, rise, sway, turn, upright
from model.types import Array

FPS = 30.0
FRAMES = (40, 75)
PATCH = (0.016, 0.028)
"""Radius of what a hand holds [m]."""
FINGERS = (5, 9)
"""Controllers per hand: from, below."""
OUTSIDE = 0.003
"""How far off the surface the controllers are [m]."""
CLEARANCE = 0.0005
"""Between the ground and the lowest point of an object that lies on it [m]."""
FORCE = 12.0
"""What a hand usually presses or pulls with [N]: sets how far stiff objects are deformed."""
FIRMNESS = 0.7
"""Standard deviation of the logarithm of that force from clip to clip. A hand stops at a force, not at a
strain, so how far it goes tells something of the modulus; with one force for all it would tell it exactly."""
ALL_INTERACTIONS: tuple[Interaction, ...] = (
    "lift",
    "double_lift",
    "push",
    "stretch",
    "fold",
    "drop",
    "shake",
)


@dataclass(frozen=True)
class Handled:
    """What an interaction needs to know of an object, in its own pose at rest."""

    surface: Float64[Array, "M 3"]
    """[m]."""
    normals: Float64[Array, "M 3"]
    grips: Float64[Array, "H 3"]
    """Where a hand may take it, the outermost places first [m]."""
    modulus: float
    """Of the softest part [Pa]."""
    solid: bool
    """Neither a sheet nor a rope."""


@dataclass(frozen=True)
class Script:
    """What happens."""

    times: Float64[Array, " T"]
    """[s]."""
    rotation: Float64[Array, "3 3"]
    """Of the object at rest into the world."""
    shift: Float64[Array, " 3"]
    """[m]."""
    controllers: Float32[Array, "T C 3"]
    """[m]."""
    hands: Float64[Array, "T H 3"]
    """Middle of each hand [m]."""


@dataclass(frozen=True)
class _Posed:
    """The object where it lies before anything happens, and the clock."""

    rotation: Float64[Array, "3 3"]
    shift: Float64[Array, " 3"]
    surface: Float64[Array, "M 3"]
    normals: Float64[Array, "M 3"]
    grips: Float64[Array, "H 3"]
    times: Float64[Array, " T"]
    object: Handled

    def height(self) -> float:
        """Of its highest point [m]."""
        return float(self.surface[:, 2].max())

    def size(self) -> float:
        """Its largest extent [m]."""
        return float(np.ptp(self.surface, axis=0).max())


def draw_script(interaction: Interaction, handled: Handled, rng: np.random.Generator) -> Script:
    """One way of doing this to the object."""
    times = np.arange(int(rng.integers(*FRAMES, endpoint=True))) / FPS
    return _SCRIPTS[interaction](handled, times, rng)


def _lift(handled: Handled, times: Float64[Array, " T"], rng: np.random.Generator) -> Script:
    """One hand takes an end, raises it and sways."""
    posed = _lying(handled, times, rng)
    place = posed.grips[rng.integers(len(posed.grips))]
    way = rise(times, rng.uniform(0.5, 1.0) * posed.size() + 0.03, rng) + sway(times, 0.05, rng)
    return _script(posed, [(place, way, turn(times, 0.35, rng))], rng)


def _double_lift(handled: Handled, times: Float64[Array, " T"], rng: np.random.Generator) -> Script:
    """Two hands take two ends and raise them, one a little more than the other, coming closer."""
    posed = _lying(handled, times, rng)
    first, second = _far_apart(posed.grips)
    height, swing = rng.uniform(0.35, 0.8) * posed.size() + 0.03, sway(times, 0.03, rng)
    begin = rng.uniform(0.05, 0.2)
    closer = rng.uniform(0.0, 0.35) * ease(times, begin, begin + 1.0)[:, None] * (second - first) / 2.0
    moves = [
        (first, rise(times, height, rng) + swing + closer, turn(times, 0.2, rng)),
        (second, rise(times, height * rng.uniform(0.75, 1.0), rng) + swing - closer, turn(times, 0.2, rng)),
    ]
    return _script(posed, moves, rng)


def _push(handled: Handled, times: Float64[Array, " T"], rng: np.random.Generator) -> Script:
    """A hand presses an object down and sideways and lets it come back, or drags a cloth or cord."""
    posed = _lying(handled, times, rng)
    sideways = direction(rng)
    begin, pace = rng.uniform(0.05, 0.2), rng.uniform(0.3, 0.5)
    press = np.sin(np.pi * np.clip((times - begin) / pace, 0.0, None)) ** 2
    if handled.solid:
        place = posed.surface[posed.surface[:, 2] >= np.quantile(posed.surface[:, 2], 0.97)].mean(axis=0)
        place = place + 0.15 * posed.size() * rng.uniform(-1.0, 1.0, 3) * (1.0, 1.0, 0.0)
        # the nearest place of the surface below, height hardly counted, and of those the upper side
        place = posed.surface[np.argmin((((posed.surface - place) * (1.0, 1.0, 0.2)) ** 2).sum(axis=1))]
        give = min(0.35, _force(rng) / (2e-3 * handled.modulus))
        depth = give * place[2]
        slide = rng.uniform(0.02, 0.08) * ease(times, begin, begin + rng.uniform(0.8, 1.5))
        way = np.outer(press, [0.0, 0.0, -depth]) + np.outer(0.7 * depth * press + slide, sideways)
    else:
        place = posed.grips[rng.integers(len(posed.grips))]
        outward = (place - posed.surface.mean(axis=0)) * (1.0, 1.0, 0.0)
        outward = outward / max(float(np.linalg.norm(outward)), 0.02)
        reach = rng.uniform(0.06, 0.15)
        stroke = reach * (ease(times, begin, begin + 0.6) - 0.5 * ease(times, begin + 0.7, begin + 1.4))
        way = np.outer(stroke, 0.4 * outward + 0.9 * sideways + np.array([0.0, 0.0, 0.12]))
    return _script(posed, [(place, way, turn(times, 0.1, rng))], rng)


def _stretch(handled: Handled, times: Float64[Array, " T"], rng: np.random.Generator) -> Script:
    """Two hands take two ends, pull them apart and let go of the pull, and again."""
    posed = _lying(handled, times, rng)
    first, second = _far_apart(posed.grips)
    apart = float(np.linalg.norm(second - first))
    strain = float(np.clip(_force(rng) / (1.5e-3 * handled.modulus), 0.02, 0.3)) * rng.uniform(0.6, 1.1)
    begin, pace = rng.uniform(0.05, 0.2), rng.uniform(0.35, 0.6)
    pull = np.sin(np.pi * np.clip((times - begin) / (2.0 * pace), 0.0, None)) ** 2
    way = np.outer(strain * apart * pull, (second - first) / max(apart, 1e-9))
    raised = np.outer(ease(times, 0.0, 0.5), [0.0, 0.0, rng.uniform(0.02, 0.08)])
    share = rng.uniform(0.0, 0.5)
    still = np.zeros((len(times), 3))
    moves = [(first, raised - share * way, still), (second, raised + (1.0 - share) * way, still)]
    return _script(posed, moves, rng)


def _force(rng: np.random.Generator) -> float:
    """Of the hand in one clip [N]."""
    return FORCE * float(np.exp(FIRMNESS * rng.standard_normal()))


def _fold(handled: Handled, times: Float64[Array, " T"], rng: np.random.Generator) -> Script:
    """A hand takes an end and brings it over the object towards the other end; of a solid, only so far."""
    posed = _lying(handled, times, rng)
    place, other = _far_apart(posed.grips)[:: int(rng.choice([-1, 1]))]
    over = (other - place) * (1.0, 1.0, 0.0)
    length = max(float(np.linalg.norm(over)), 0.05)
    over = over / length
    bend = rng.uniform(0.3, 0.55) if handled.solid else 1.0
    target = length * rng.uniform(0.55, 0.9)
    begin = rng.uniform(0.05, 0.2)
    share = ease(times, begin, begin + rng.uniform(0.9, 1.4))
    angle = bend * np.pi * share
    peak = target / 2.0 * rng.uniform(0.8, 1.1)
    way = np.outer(target / 2.0 * (1.0 - np.cos(angle)), over)
    way += np.outer(peak * np.sin(angle) + 0.02 * share, [0.0, 0.0, 1.0])
    axis = np.cross([0.0, 0.0, 1.0], over)
    turned = np.outer(rng.uniform(0.4, 0.8) * angle, axis)
    return _script(posed, [(place, way, turned)], rng)


def _drop(handled: Handled, times: Float64[Array, " T"], rng: np.random.Generator) -> Script:
    """It falls, a little tilted: how it lands must not be a matter of chance."""
    tilt = Rotation.from_rotvec(rng.uniform(0.0, 0.12 if handled.solid else 0.6) * direction(rng))
    rotation = (tilt * Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)])).as_matrix()
    posed = _posed(handled, rotation, rng.uniform(0.05, 0.25), times)
    return _script(posed, [], rng)


def _shake(handled: Handled, times: Float64[Array, " T"], rng: np.random.Generator) -> Script:
    """A hand holds it in the air by one end, from which it mostly hangs already, and shakes it."""
    which = int(rng.integers(len(handled.grips)))
    spin = Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)])
    lying = _posed(handled, spin.as_matrix(), 0.0, times)
    if handled.solid and rng.random() < 0.4:
        posed = _posed(handled, spin.as_matrix(), lying.size() * rng.uniform(0.6, 0.9) + 0.08, times)
    else:
        up = handled.grips[which] - handled.surface.mean(axis=0)
        swung = Rotation.from_rotvec(rng.normal(0.0, 0.1, 3)) * spin * upright(up)
        posed = _posed(handled, swung.as_matrix(), rng.uniform(0.08, 0.25), times)
    place = posed.grips[which]
    rate, begin = rng.uniform(0.9, 2.2), rng.uniform(0.0, 0.4)
    swing = np.sin(2.0 * np.pi * rate * (times - begin)) * ease(times, begin, begin + 0.4)
    aim = direction(rng) + np.array([0.0, 0.0, rng.uniform(-0.8, 0.8)])
    way = np.outer(rng.uniform(0.025, 0.06) / rate**0.5 * swing, aim)
    return _script(posed, [(place, way, turn(times, 0.3, rng))], rng)


_SCRIPTS: Mapping[Interaction, Callable[[Handled, Float64[Array, " T"], np.random.Generator], Script]] = {
    "lift": _lift,
    "double_lift": _double_lift,
    "push": _push,
    "stretch": _stretch,
    "fold": _fold,
    "drop": _drop,
    "shake": _shake,
}


def _lying(handled: Handled, times: Float64[Array, " T"], rng: np.random.Generator) -> _Posed:
    """On the ground, turned about the vertical."""
    rotation = Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)]).as_matrix()
    return _posed(handled, rotation, CLEARANCE, times)


def _posed(
    handled: Handled, rotation: Float64[Array, "3 3"], height: float, times: Float64[Array, " T"]
) -> _Posed:
    """Turned, with its lowest point at a height [m]."""
    turned = handled.surface @ rotation.T
    shift = np.array([0.0, 0.0, height - float(turned[:, 2].min())])
    grips = handled.grips @ rotation.T + shift
    return _Posed(rotation, shift, turned + shift, handled.normals @ rotation.T, grips, times, handled)


def _script(
    posed: _Posed,
    moves: list[tuple[Float64[Array, " 3"], Float64[Array, "T 3"], Float64[Array, "T 3"]]],
    rng: np.random.Generator,
) -> Script:
    """Hands that take the object at places, move along ways [m] and turn (rotation vectors)."""
    controllers, hands = [], []
    for place, way, turned in moves:
        held = _touched(posed, place, rng)
        middle = held.mean(axis=0)
        turns = Rotation.from_rotvec(turned).as_matrix()
        moved = np.einsum("tij,cj->tci", turns, held - middle) + middle + way[:, None]
        controllers.append(moved)
        hands.append(middle + way)
    count = len(posed.times)
    return Script(
        posed.times,
        posed.rotation,
        posed.shift,
        np.concatenate([np.zeros((count, 0, 3)), *controllers], axis=1).astype(np.float32),
        np.stack(hands, axis=1) if hands else np.zeros((count, 0, 3)),
    )


def _touched(posed: _Posed, place: Float64[Array, " 3"], rng: np.random.Generator) -> Float64[Array, "C 3"]:
    """Where fingers are: spread over the surface around a place, a little off it and above the ground."""
    away = np.linalg.norm(posed.surface - place, axis=1)
    count = int(rng.integers(*FINGERS))
    near = np.flatnonzero(away <= away.min() + rng.uniform(*PATCH))
    if len(near) < count:
        near = np.argsort(away)[:count]
    chosen: Int[Array, " C"] = near[spread(posed.surface[near], count, rng)]
    fingers = posed.surface[chosen] + OUTSIDE * posed.normals[chosen]
    return np.asarray(np.maximum(fingers, [-np.inf, -np.inf, 0.001]), np.float64)


def _far_apart(grips: Float64[Array, "H 3"]) -> tuple[Float64[Array, " 3"], Float64[Array, " 3"]]:
    """The first place, and the one farthest from it."""
    return grips[0], grips[int(np.linalg.norm(grips - grips[0], axis=1).argmax())]
