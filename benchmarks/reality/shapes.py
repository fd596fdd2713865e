"""Objects as geometry: a curve, an outline, or a volume that says what is inside.

Each generator makes a mesh of its own from these; what is observed are points of the surface, the same for
both.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.reality.world import Array, Kind

Inside = Callable[[Array], Array]
RELIEF = 0.004
"""Of a cloth that lies on a table [m]."""


@dataclass(frozen=True)
class Shape:
    """A rest shape, resting on z = 0."""

    kind: Kind
    name: str
    box: Array
    """Corners of the box around it [2, 3] m."""
    inside: Inside
    """Of points [n, 3] of the curve's parameter (rope), the plane (sheet) or space (solid)."""
    curve: Callable[[Array], Array]
    """Arc length [m] to positions, of a rope."""
    surface: Array
    """The observed points [N, 3] m."""
    handles: Mapping[str, Array]
    """Where a hand may hold: positions [3] m."""
    radius: float
    """Half the thickness of a rope [m]; of a sheet as well."""
    relief: Callable[[Array], Array] = lambda p: np.zeros(len(p))
    """Height [m] of a sheet at [n, 2]: none is flat, and a flat one would buckle by rounding errors."""

    @property
    def length(self) -> float:
        """Longest side [m]."""
        return float((self.box[1] - self.box[0]).max())


def spread(points: Array, count: int, rng: np.random.Generator) -> Array:
    """Indices of `count` points, each far from those taken before."""
    taken = [int(rng.integers(len(points)))]
    distance = np.full(len(points), np.inf)
    while len(taken) < min(count, len(points)):
        distance = np.minimum(distance, ((points - points[taken[-1]]) ** 2).sum(axis=1))
        taken.append(int(distance.argmax()))
    return np.array(taken)


def rope(rng: np.random.Generator, count: int, curved: bool) -> Shape:
    """A rope of 0.45 to 1.1 m on the ground, straight or in an arc."""
    length, radius = rng.uniform(0.45, 1.1), rng.uniform(0.004, 0.012)
    bend = rng.uniform(0.6, 2.2) / length * rng.choice([-1, 1]) if curved else 1e-6

    def curve(s: Array) -> Array:
        a = (np.asarray(s) - length / 2) * bend
        return np.stack([np.sin(a) / bend, (1 - np.cos(a)) / bend, np.full_like(a, radius)], axis=-1)

    along = np.sort(rng.uniform(0, length, max(count // 3, 24)))
    ends = {
        name: curve(np.array([share * length]))[0]
        for name, share in (("end", 0.02), ("other end", 0.98), ("middle", 0.5), ("third", 0.3))
    }
    line = curve(np.linspace(0, length, 50))
    return Shape(
        kind="rope",
        name="curved rope" if curved else "rope",
        box=np.array([[0, 0, 0], [length, 0, 0]]) if not curved else np.stack([line.min(0), line.max(0)]),
        inside=lambda s: (s[:, 0] >= 0) & (s[:, 0] <= length),
        curve=curve,
        surface=curve(along),
        handles=ends,
        radius=radius,
    )


OUTLINES: Mapping[str, Inside] = {
    "rectangle": lambda p: (np.abs(p) <= 1).all(axis=1),
    "ellipse": lambda p: (p**2).sum(axis=1) <= 1,
    "trapezium": lambda p: (np.abs(p[:, 1]) <= 1) & (np.abs(p[:, 0]) <= 0.8 + 0.2 * p[:, 1]),
    "notched": lambda p: (np.abs(p) <= 1).all(axis=1) & ~((p[:, 0] > 0.35) & (p[:, 1] > 0.35)),
    "slit": lambda p: (np.abs(p) <= 1).all(axis=1) & ~((np.abs(p[:, 0]) < 0.06) & (p[:, 1] > 0.0)),
}


def sheet(rng: np.random.Generator, count: int, outline: str) -> Shape:
    """A cloth of 0.25 to 0.5 m, flat on the ground."""
    half = rng.uniform(0.13, 0.25, 2)
    inner = OUTLINES[outline]
    drawn = rng.uniform(-1, 1, (6 * count, 2))
    drawn = drawn[inner(drawn)]
    surface = drawn[spread(drawn, count, rng)] * half
    z = 0.003
    waves = rng.normal(size=(6, 2)) * np.pi / half.max() * 0.8
    phases, sizes = rng.uniform(0, 2 * np.pi, 6), rng.uniform(0.3, 1.0, 6)

    def relief(p: Array) -> Array:
        return z + RELIEF * (1 + np.sin(p @ waves.T + phases) @ sizes / sizes.sum())

    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41)), axis=-1).reshape(-1, 2)
    grid = grid[inner(grid)] * half
    aims = {
        "corner": (-1, -1),
        "next corner": (1, -1),
        "third corner": (-1, 1),
        "side": (-1, 0),
        "other side": (1, 0),
        "front": (0, -1),
        "middle": (0, 0),
    }
    handles = {}
    for name, aim in aims.items():
        goal = np.array(aim) * half * 0.97
        nearest = grid[((grid - goal) ** 2).sum(axis=1).argmin()]
        handles[name] = np.array([*nearest, *relief(nearest[None])])
    return Shape(
        kind="sheet",
        name=f"{outline} cloth",
        box=np.array([[*-half, 0], [*half, 2 * z]]),
        inside=lambda p: inner(p[:, :2] / half),
        curve=lambda s: s,
        surface=np.column_stack([surface, relief(surface)]),
        handles=handles,
        radius=z,
        relief=relief,
    )


def block(rng: np.random.Generator, count: int, name: str) -> Shape:
    """A box, an L or a T of soft matter, 0.15 to 0.3 m long."""
    length, width, height = rng.uniform(0.18, 0.3), rng.uniform(0.08, 0.14), rng.uniform(0.05, 0.1)

    def inside(p: Array) -> Array:
        x, y, z = (p / [length, width, height]).T
        hull = (np.abs(x) <= 0.5) & (np.abs(y) <= 0.5) & (z >= 0) & (z <= 1)
        if name == "L block":
            return hull & ((x < -0.1) | (z < 0.55))
        if name == "T block":
            return hull & ((np.abs(y) < 0.25) | (x > 0.1))
        return hull

    box = np.array([[-length / 2, -width / 2, 0], [length / 2, width / 2, height]])
    return _solid(name, box, inside, count, rng)


def plush(rng: np.random.Generator, count: int) -> Shape:
    """A trunk with a head and four limbs, lying on its back."""
    trunk = rng.uniform([0.07, 0.045, 0.035], [0.1, 0.065, 0.05])
    limb, reach = rng.uniform(0.02, 0.028), rng.uniform(0.06, 0.1)
    head = rng.uniform(0.035, 0.05)
    middle = np.array([0.0, 0.0, max(trunk[2], head)])
    bones = []
    for sx in (-1, 1):
        for sy in (-1, 1):
            out = sx * (trunk[0] * 0.7 + reach * rng.uniform(0.5, 1))
            root = np.array([sx * trunk[0] * 0.7, sy * trunk[1] * 0.6, 0.0])
            tip = np.array([out, sy * (trunk[1] + reach), limb - middle[2]])
            bones.append((middle + root, middle + tip))
    crown = middle + np.array([trunk[0] + 0.7 * head, 0.0, 0.0])

    def inside(p: Array) -> Array:
        result = (((p - middle) / trunk) ** 2).sum(axis=1) <= 1
        result |= ((p - crown) ** 2).sum(axis=1) <= head**2
        for a, b in bones:
            along = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
            result |= ((p - a - along[:, None] * (b - a)) ** 2).sum(axis=1) <= limb**2
        return result & (p[:, 2] >= 0)

    ends = np.array([*(end for bone in bones for end in bone), crown, middle])
    box = np.stack([ends.min(0) - 0.06, ends.max(0) + 0.06])
    box[0, 2] = 0.0
    return _solid("plush", box, inside, count, rng)


def round_solid(rng: np.random.Generator, count: int, name: str) -> Shape:
    """A lying cylinder, a wedge or a ring."""
    length, width = rng.uniform(0.18, 0.3), rng.uniform(0.07, 0.11)

    def inside(p: Array) -> Array:
        x, y, z = p.T
        if name == "cylinder":
            return (np.abs(x) <= length / 2) & (y**2 + (z - width / 2) ** 2 <= width**2 / 4)
        if name == "wedge":
            return (
                (np.abs(x) <= length / 2)
                & (np.abs(y) <= width / 2)
                & (z >= 0)
                & (z <= width * (0.75 - x / length * 0.7))
            )
        away = np.hypot(x, y) - (length / 2 - width / 3)
        return away**2 + (z - width / 3) ** 2 <= (width / 3) ** 2

    side = length / 2 if name == "ring" else width / 2
    box = np.array([[-length / 2, -side, 0], [length / 2, side, 1.15 * width]])
    return _solid(name, box, inside, count, rng)


def _solid(name: str, box: Array, inside: Inside, count: int, rng: np.random.Generator) -> Shape:
    drawn = rng.uniform(box[0], box[1], (30000, 3))
    within = drawn[inside(drawn)]
    box = np.stack([within.min(0), within.max(0)])
    surface = _skin(within[rng.integers(len(within), size=8 * count)], inside, rng)
    surface = surface[spread(surface, count, rng)]
    middle = within.mean(axis=0)
    aims = {
        "left": (-1, 0, 0),
        "right": (1, 0, 0),
        "front": (0, -1, 0),
        "back": (0, 1, 0),
        "top": (0, 0, 1),
        "left top": (-1, 0, 1),
        "right top": (1, 0, 1),
        "left corner": (-1, -1, 0),
        "right corner": (1, 1, 0),
    }
    scale = box[1] - box[0]
    handles = {}
    for key, aim in aims.items():
        score = ((within - middle) / scale) @ np.array(aim) - (
            0.3 * np.abs(((within - middle) / scale)[:, np.array(aim) == 0])
        ).sum(axis=1)
        handles[key] = within[score.argmax()]
    return Shape("solid", name, box, inside, lambda s: s, surface, handles, 0.0)


def _skin(start: Array, inside: Inside, rng: np.random.Generator) -> Array:
    """Where rays from inside leave the volume."""
    direction = rng.normal(size=start.shape)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    low, high = np.zeros(len(start)), np.full(len(start), 0.6)
    step = 0.004
    reached = np.zeros(len(start), bool)
    for count in range(1, 150):
        out = ~inside(start + count * step * direction) & ~reached
        low[out], high[out] = (count - 1) * step, count * step
        reached |= out
    for _ in range(12):
        middle = (low + high) / 2
        within = inside(start + middle[:, None] * direction)
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    return start + low[:, None] * direction
