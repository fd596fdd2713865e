"""What the hands do with an object: scripts of grips and smooth motions.

Every script begins with the object at rest in its rest shape, and the hands still for a moment.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.reality.shapes import Shape
from benchmarks.reality.world import RATE, Array, Hand, Kind, Scene, World

Stop = tuple[float, Array | Sequence[float]]
Generator = np.random.Generator


def glide(stops: Sequence[Stop], duration: float) -> Array:
    """Vectors [samples, 3] that go from stop to stop with no jerk at either end (Flash and Hogan 1985)."""
    grid = np.arange(int(np.ceil(duration * RATE)) + 2) / RATE
    path = np.zeros((len(grid), 3))
    when, where = 0.0, np.zeros(3)
    for until, goal in stops:
        goal = np.asarray(goal, float)
        part = (grid > when) & (grid <= until)
        s = ((grid[part] - when) / max(until - when, 1e-9))[:, None]
        path[part] = where + (goal - where) * s**3 * (10 - 15 * s + 6 * s**2)
        when, where = until, goal
    path[grid > when] = where
    return path


def swing(grid: Array, start: float, end: float, low: float, high: float) -> Array:
    """A sine [samples] whose frequency rises from `low` to `high` [1/s], eased in and out."""
    t = np.clip(grid - start, 0, end - start)
    phase = 2 * np.pi * (low * t + (high - low) * t**2 / (2 * (end - start)))
    ease = np.clip((grid - start) / 0.3, 0, 1) * np.clip((end - grid) / 0.3, 0, 1)
    return np.sin(phase) * ease


@dataclass(frozen=True)
class Script:
    """An interaction: which objects it suits, whether it needs the ground, and what the hands do."""

    kinds: tuple[Kind, ...]
    ground: bool
    play: Callable[[Shape, float, Generator], list[tuple[str, Array, Array]]]
    """Handles with the displacement and turn [samples, 3] of each hand, in the frame of the object."""


def _still(duration: float) -> Array:
    return glide([], duration)


def _ends(shape: Shape, rng: Generator) -> tuple[str, str]:
    pairs = {
        "rope": [("end", "other end")],
        "sheet": [("side", "other side"), ("corner", "next corner")],
        "solid": [("left", "right")],
    }[shape.kind]
    first, second = pairs[rng.integers(len(pairs))]
    return (first, second) if rng.random() < 0.5 else (second, first)


def _one(shape: Shape, rng: Generator) -> str:
    names = {
        "rope": ["end", "other end", "middle", "third"],
        "sheet": ["corner", "third corner", "side", "middle", "front"],
        "solid": ["left", "right", "top", "left top", "right top"],
    }[shape.kind]
    return names[rng.integers(len(names))]


def _apart(shape: Shape, first: str, second: str) -> Array:
    way = shape.handles[second] - shape.handles[first]
    way[2] = 0.0
    return way / max(np.linalg.norm(way), 1e-9)


def lift(shape: Shape, duration: float, rng: Generator) -> list[tuple[str, Array, Array]]:
    """Up, a sway, a hold, half down again; by one hand or two."""
    up = rng.uniform(0.5, 0.9) * shape.length if shape.kind != "solid" else rng.uniform(0.12, 0.3)
    side = rng.uniform(0.05, 0.15) * rng.choice([-1, 1])
    t = np.array([0.3, 1.1, 1.6, 2.0, 3.0, 3.6, 4.2]) * duration / 4.5 * rng.uniform(0.9, 1.05)
    stops = [
        (t[0], (0, 0, 0)),
        (t[1], (0, 0, up)),
        (t[2], (side, side / 2, up)),
        (t[3], (-side, 0, up)),
        (t[4], (-side, 0, up)),
        (t[5], (0, 0, up / 2)),
    ]
    path = glide(stops, duration)
    names = [_one(shape, rng)] if rng.random() < 0.5 else list(_ends(shape, rng))
    return [(name, path, _still(duration)) for name in names]


def hang(shape: Shape, duration: float, rng: Generator) -> list[tuple[str, Array, Array]]:
    """Held in the air where nothing else supports it; it sags, then is swayed."""
    side, up = rng.uniform(0.05, 0.2) * rng.choice([-1, 1]), rng.uniform(-0.1, 0.1)
    t = np.array([1.2, 1.8, 2.4, 3.4, 4.0]) * duration / 4.5
    path = glide(
        [
            (t[0], (0, 0, 0)),
            (t[1], (side, 0, up)),
            (t[2], (-side, side / 2, 0)),
            (t[3], (-side, side / 2, 0)),
            (t[4], (0, 0, up)),
        ],
        duration,
    )
    names = [_one(shape, rng)] if rng.random() < 0.4 else list(_ends(shape, rng))
    return [(name, path, _still(duration)) for name in names]


def stretch(shape: Shape, duration: float, rng: Generator) -> list[tuple[str, Array, Array]]:
    """Lifted by two hands, pulled apart, held, let back, pulled again."""
    first, second = _ends(shape, rng)
    way = _apart(shape, first, second)
    far, up = rng.uniform(0.06, 0.2) * shape.length, rng.uniform(0.1, 0.2)
    repeat = rng.uniform(0.6, 1.3)
    t = np.array([0.25, 0.7, 1.2, 2.0, 2.5, 3.0, 3.6, 4.1]) * duration / 4.5
    amount = [0, 0, 1, 1, 0, 0, repeat, repeat]
    high = np.array([0, up, up, up, up, up, up, up])
    paths = [
        glide(
            [
                (when, sign * way * far * a / 2 + np.array([0, 0, h]))
                for when, a, h in zip(t, amount, high, strict=True)
            ],
            duration,
        )
        for sign in (-1, 1)
    ]
    return [(first, paths[0], _still(duration)), (second, paths[1], _still(duration))]


def staircase(shape: Shape, duration: float, rng: Generator) -> list[tuple[str, Array, Array]]:
    """Pulled apart in steps with holds, back in steps, and a rest."""
    first, second = _ends(shape, rng)
    way = _apart(shape, first, second)
    far, up = rng.uniform(0.08, 0.2) * shape.length, rng.uniform(0.1, 0.2)
    t = np.array([0.2, 0.6, 0.9, 1.3, 1.6, 2.0, 2.3, 2.7, 2.9, 3.3]) * duration / 4.5
    amount = [0, 0, 0.5, 0.5, 1, 1, 0.5, 0.5, 0, 0]
    paths = [
        glide(
            [
                (when, sign * way * far * a / 2 + np.array([0, 0, up if i else 0]))
                for i, (when, a) in enumerate(zip(t, amount, strict=True))
            ],
            duration,
        )
        for sign in (-1, 1)
    ]
    return [(first, paths[0], _still(duration)), (second, paths[1], _still(duration))]


def shake(shape: Shape, duration: float, rng: Generator) -> list[tuple[str, Array, Array]]:
    """Lifted and shaken, faster and faster."""
    up = rng.uniform(0.4, 0.8) * shape.length if shape.kind != "solid" else rng.uniform(0.15, 0.25)
    path = glide([(0.25, (0, 0, 0)), (0.9, (0, 0, up))], duration)
    grid = np.arange(len(path)) / RATE
    way = rng.normal(size=3) * [1, 1, 0.6]
    way /= np.linalg.norm(way)
    wave = swing(grid, 1.1, 0.9 * duration, rng.uniform(0.6, 1.0), rng.uniform(1.6, 2.6)) * rng.uniform(
        0.03, 0.07
    )
    names = [_one(shape, rng)] if rng.random() < 0.6 else list(_ends(shape, rng))
    return [(name, path + wave[:, None] * way, _still(duration)) for name in names]


def press(shape: Shape, duration: float, rng: Generator) -> list[tuple[str, Array, Array]]:
    """A hand on top goes down, holds, comes back, and goes down again."""
    name = ["top", "left top", "right top"][rng.integers(3)]
    deep = -rng.uniform(0.2, 0.4) * shape.handles[name][2]
    t = np.array([0.3, 0.8, 1.8, 2.1, 2.9, 3.3, 3.9]) * duration / 4.5
    amount = [0, 1, 1, 0, 0, rng.uniform(0.7, 1.1), 0]
    return [
        (
            name,
            glide([(when, (0, 0, deep * a)) for when, a in zip(t, amount, strict=True)], duration),
            _still(duration),
        )
    ]


def drag(shape: Shape, duration: float, rng: Generator) -> list[tuple[str, Array, Array]]:
    """Drawn over the ground slowly, a stop, then fast and back."""
    name = _ends(shape, rng)[0]
    way = -_apart(shape, name, "middle" if "middle" in shape.handles else "top")
    if not np.isfinite(way).all() or np.linalg.norm(way) < 0.5:
        way = np.array([1.0, 0, 0])
    far, low = rng.uniform(0.15, 0.3), rng.uniform(0.0, 0.015)
    t = np.array([0.3, 0.5, 2.0, 2.5, 3.0, 3.4, 4.1]) * duration / 4.5
    where = [0, 0, 0.35, 0.35, 1.0, 1.0, 0.6]
    side = np.array([-way[1], way[0], 0]) * rng.uniform(-0.1, 0.1)
    stops = [
        (when, (way * far + side * (s > 0.5)) * s + np.array([0, 0, low if i else 0]))
        for i, (when, s) in enumerate(zip(t, where, strict=True))
    ]
    return [(name, glide(stops, duration), _still(duration))]


def fold(shape: Shape, duration: float, rng: Generator) -> list[tuple[str, Array, Array]]:
    """One side is carried over the other in an arc, and partly back."""
    first, second = _ends(shape, rng)
    way = _apart(shape, first, second)
    span = np.linalg.norm(shape.handles[second] - shape.handles[first]) * rng.uniform(0.6, 0.9)
    angles = np.concatenate([np.zeros(1), np.linspace(0, np.pi, 9), [np.pi, np.pi * 0.6]])
    t = np.concatenate([[0.3], np.linspace(0.3, 2.6, 9), [3.3, 4.2]]) * duration / 4.5
    height = 0.8 * span / 2
    stops = [
        (when, way * span / 2 * (1 - np.cos(a)) + np.array([0, 0, height * np.sin(a) + 0.02 * (a > 0)]))
        for when, a in zip(t, angles, strict=True)
    ]
    return [(first, _polyline(stops, duration), _still(duration))]


def twist(shape: Shape, duration: float, rng: Generator) -> list[tuple[str, Array, Array]]:
    """Lifted by two hands, of which one turns about the axis between them."""
    first, second = _ends(shape, rng)
    way, up, angle = _apart(shape, first, second), rng.uniform(0.1, 0.2), rng.uniform(0.6, 1.4)
    t = np.array([0.3, 0.8, 1.6, 2.4, 3.2, 3.9]) * duration / 4.5
    path = glide([(t[0], (0, 0, 0)), (t[1], (0, 0, up))], duration)
    turn = glide(
        [(when, way * angle * a) for when, a in zip(t, (0, 0, 1, 1, -0.5, -0.5), strict=True)], duration
    )
    return [(first, path, turn), (second, path, _still(duration))]


def drop(shape: Shape, duration: float, rng: Generator) -> list[tuple[str, Array, Array]]:
    """No hand: it falls to the ground."""
    return []


def _polyline(stops: Sequence[Stop], duration: float) -> Array:
    grid = np.arange(int(np.ceil(duration * RATE)) + 2) / RATE
    when, where = np.array([s[0] for s in stops]), np.array([s[1] for s in stops], float)
    path = np.stack([np.interp(grid, when, where[:, k], left=0.0) for k in range(3)], axis=1)
    kernel = np.hanning(49) / np.hanning(49).sum()
    padded = np.pad(path, ((24, 24), (0, 0)), mode="edge")
    return np.stack([np.convolve(padded[:, k], kernel, mode="valid") for k in range(3)], axis=1)


EVERY: tuple[Kind, ...] = ("rope", "sheet", "solid")
SCRIPTS: Mapping[str, Script] = {
    "lift": Script(EVERY, True, lift),
    "hang": Script(EVERY, False, hang),
    "stretch": Script(EVERY, True, stretch),
    "staircase": Script(EVERY, True, staircase),
    "shake": Script(EVERY, True, shake),
    "press": Script(("solid",), True, press),
    "drag": Script(EVERY, True, drag),
    "fold": Script(("rope", "sheet"), True, fold),
    "twist": Script(("sheet", "solid"), True, twist),
    "drop": Script(("solid",), True, drop),
}


def stage(name: str, shape: Shape, times: Array, turn: Array, shift: Array, rng: Generator) -> Scene:
    """Play a script with an object that lies turned by `turn` and shifted by `shift` [3] m.

    A dropped object starts higher and tilted. Hands move in the frame of the object.
    """
    script = SCRIPTS[name]
    duration = float(times[-1])
    if name == "drop":
        axis = rng.normal(size=3) * [1, 1, 0.2]
        turn = rotation(axis / np.linalg.norm(axis) * rng.uniform(0.2, 0.9)) @ turn
        low = (shape.surface @ turn.T)[:, 2].min()
        shift = shift + np.array([0, 0, rng.uniform(0.1, 0.35) - low])
    reach = {"rope": (0.018, 0.03), "sheet": (0.022, 0.035), "solid": (0.025, 0.04)}[shape.kind]
    hands = tuple(
        Hand(
            place=turn @ shape.handles[handle] + shift,
            reach=rng.uniform(*reach),
            offset=offset @ turn.T,
            turn=bend @ turn.T,
        )
        for handle, offset, bend in script.play(shape, duration, rng)
    )
    return Scene(times, hands, turn, shift, 0.0 if script.ground else None, interaction=name)


def rotation(vector: Array) -> Array:
    """Rotation matrix [3, 3] of a rotation vector [3] (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew


def follow(hand: Hand, points: Array, delay: float = 0.0, extra: Array | None = None) -> Array:
    """Where points [n, 3] fixed to a hand are at its samples [samples, n, 3].

    Args:
        hand: The hand.
        points: In the first frame [m].
        delay: By how much [s] the hand really comes later than `hand` says.
        extra: Rotation vectors [samples, 3] added to its own.
    """
    grid = np.arange(len(hand.offset)) / RATE
    late = np.clip(grid - delay, 0.0, grid[-1])
    offset = np.stack([np.interp(late, grid, hand.offset[:, k]) for k in range(3)], axis=1)
    turn = np.stack([np.interp(late, grid, hand.turn[:, k]) for k in range(3)], axis=1)
    if extra is not None:
        turn = turn + extra
    arm = points - hand.place
    angle = np.linalg.norm(turn, axis=1)
    if angle.max() < 1e-12:
        turned = np.broadcast_to(arm, (len(turn), *arm.shape))
    else:
        matrices = np.stack([rotation(vector) for vector in turn])
        turned = np.einsum("sij,nj->sni", matrices, arm)
    return hand.place + offset[:, None] + turned


def held_share(world: World) -> Array:
    """How near the observed points [N] are to a grip, 0..1."""
    placed = world.shape.surface @ world.scene.turn.T + world.scene.shift
    share = np.zeros(len(placed))
    for hand in world.scene.hands:
        distance = np.linalg.norm(placed - hand.place, axis=1)
        share = np.maximum(share, np.clip(2.0 - distance / max(hand.reach, distance.min()), 0.0, 1.0))
    return share
