"""The six classes of objects: what each may look like, which parts it has, where a hand takes it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from model.scenes.case import ObjectClass
from model.scenes.world.body import Block, Body, Capsule, Cut, Solid
from model.scenes.world.sheet import Sheet
from model.types import Array, ShapeClass

CLASSES: tuple[ObjectClass, ...] = ("plush", "cloth", "rope", "foam", "bag", "mixed")


@dataclass(frozen=True)
class Shape:
    """An object before it is made of anything."""

    object_class: ObjectClass
    shape_class: ShapeClass
    body: Body
    grips: Float64[Array, "H 3"]
    """Where a hand may take it, the outermost places first [m]."""
    size: float
    """Its largest extent [m]."""


def draw_shape(object_class: ObjectClass, rng: np.random.Generator) -> Shape:
    """One object of a class."""
    return _DRAWS[object_class](rng)


def _plush(rng: np.random.Generator) -> Shape:
    """A body with a head, arms and legs, perhaps ears and a tail, that lies on its back."""
    size = rng.uniform(0.18, 0.4)
    trunk = size * rng.uniform(0.11, 0.15)
    length = size * rng.uniform(0.12, 0.2)
    thick = trunk * rng.uniform(0.95, 1.2)
    limb = size * rng.uniform(0.058, 0.08)
    pieces: list[Capsule | Block] = [Capsule((0.0, -length, thick), (0.0, length, thick), trunk, thick)]
    names = ["body"]
    head = trunk * rng.uniform(0.75, 1.05)
    top = -length - trunk * 0.6 - head * 0.7
    pieces.append(Capsule((0.0, top, head * 1.1), (0.0, top - 0.2 * head, head * 1.1), head, head * 0.9))
    names.append("head")
    grips = [(0.0, top - head, head)]
    reach = size * rng.uniform(0.2, 0.32)
    for label, base, swing in (("arms", -0.7 * length, 0.3), ("legs", 0.9 * length, 1.0)):
        for side in (-1.0, 1.0):
            angle = swing + rng.uniform(-0.35, 0.35)
            along = np.array([side * np.cos(angle), np.sin(angle)])
            first = np.array([side * trunk * 0.6, base])
            knee, tip = first + 0.5 * reach * along, first + (0.5 * reach + trunk * 0.6) * along
            tip = tip + rng.uniform(-0.15, 0.15, 2) * reach
            nodes = [(*first, thick), (*knee, limb * 1.3), (*tip, limb * 1.05)]
            end = limb * rng.uniform(0.95, 1.25)
            pieces += [
                Capsule(nodes[0], nodes[1], limb * 1.15, limb),
                Capsule(nodes[1], nodes[2], limb, end),
            ]
            names += [label, label]
            grips.append((float(tip[0]), float(tip[1]), limb))
    if rng.random() < 0.5:
        for side in (-1.0, 1.0):
            ear = (side * head * 0.75, top - 0.5 * head, head * 1.1)
            tip_of_ear = (side * head * 1.25, top - 1.1 * head, head * 0.9)
            pieces.append(Capsule(ear, tip_of_ear, limb * 0.8, limb * 0.8))
            names.append("ears")
    return _assembled("plush", "solid", pieces, names, grips[1:] + grips[:1], rng)


def _foam(rng: np.random.Generator) -> Shape:
    """A block, a slab, a pill or a ball, of one to four layers along its length."""
    half = np.sort(rng.uniform(0.035, 0.075, 3))[::-1] * np.array([rng.uniform(1.2, 2.4), 1.0, 1.0])
    layers = int(rng.integers(1, 5))
    borders = half[0] * np.linspace(-1.0, 1.0, layers + 1)[1:-1]
    borders += rng.uniform(-0.12, 0.12, layers - 1) * half[0]
    rounding = float(half[2] * rng.choice([0.15, 0.3, 0.9]))
    block = Block((0.0, 0.0, float(half[2])), (float(half[0]), float(half[1]), float(half[2])), rounding)
    ends = [(side * half[0] * 0.97, 0.0, half[2]) for side in (-1.0, 1.0)]
    middle = [(0.0, side * half[1] * 0.97, half[2]) for side in (-1.0, 1.0)]
    cut = Cut(0, tuple(borders.tolist()), tuple(range(layers)))
    return _whole("foam", "solid", Solid([block], [0], cut), [block], ends + middle)


def _bag(rng: np.random.Generator) -> Shape:
    """A bag with handles, or a box with a lid."""
    half = np.array([rng.uniform(0.06, 0.11), rng.uniform(0.04, 0.07), rng.uniform(0.05, 0.09)])
    rounding = float(half.min() * rng.choice([0.08, 0.75, 0.75]))
    top = float(2.0 * half[2])
    pieces: list[Capsule | Block] = [
        Block((0.0, 0.0, float(half[2])), (float(half[0]), float(half[1]), float(half[2])), rounding)
    ]
    arch = rng.uniform(0.04, 0.08)
    thick = rng.uniform(0.014, 0.018)
    reach = half[0] * rng.uniform(0.45, 0.7)
    nodes = [
        (float(reach * np.cos(angle)), 0.0, float(top - thick * 1.5 + (arch + thick) * np.sin(angle)))
        for angle in np.linspace(0.0, np.pi, 7)
    ]
    pieces += [Capsule(a, b, thick, thick) for a, b in pairwise(nodes)]
    handle, lid = rng.permutation([[0, 0], [1, 0], [0, 1], [1, 1], [1, 2]])[0]
    cut = Cut(2, (top * rng.uniform(0.55, 0.8),), (0, int(lid))) if lid else None
    grips = [(0.0, 0.0, top + arch)]
    grips += [(sx * half[0] * 0.95, 0.0, half[2] * 0.8) for sx in (-1.0, 1.0)]
    body = Solid(pieces, [0, *([int(handle)] * 6)], cut)
    return _whole("bag", "solid", body, pieces, grips)


def _mixed(rng: np.random.Generator) -> Shape:
    """A block or a log with legs, a neck and a head, or a soft ball between sticks."""
    half = np.array([rng.uniform(0.06, 0.11), rng.uniform(0.035, 0.06), rng.uniform(0.03, 0.05)])
    leg = rng.uniform(0.016, 0.022)
    height = rng.uniform(0.05, 0.1)
    z = float(height + half[2])
    pieces: list[Capsule | Block] = [
        Block(
            (0.0, 0.0, z),
            (float(half[0]), float(half[1]), float(half[2])),
            float(half[2] * rng.choice([0.3, 0.95])),
        )
    ]
    names = ["body"]
    grips: list[tuple[float, float, float]] = []
    for sx in (-1.0, 1.0):
        for sy in (-1.0, 1.0):
            hip = (sx * (half[0] - 1.3 * leg), sy * (half[1] - 1.1 * leg), height + 0.4 * half[2])
            foot = (hip[0] + sx * rng.uniform(0, 0.03), hip[1] + sy * rng.uniform(0, 0.02), leg)
            pieces.append(Capsule(hip, foot, leg * 1.15, leg))
            names.append("front legs" if sx > 0 else "back legs")
            grips.append((foot[0], foot[1], leg))
    neck = (half[0] * 0.9, 0.0, z + half[2] * 0.3)
    head = (half[0] * 0.9 + rng.uniform(0.03, 0.06), 0.0, z + half[2] + rng.uniform(0.02, 0.05))
    pieces.append(Capsule(neck, head, leg * 1.2, rng.uniform(0.022, 0.032)))
    names.append("head")
    if rng.random() < 0.4:
        tail = (-half[0] - rng.uniform(0.04, 0.08), 0.0, z + rng.uniform(-0.02, 0.04))
        pieces.append(Capsule((-half[0] * 0.9, 0.0, z), tail, leg, leg))
        names.append("tail")
        grips.insert(0, tail)
    grips = [head, (-half[0] * 0.97, 0.0, z), *grips]
    return _assembled("mixed", "solid", pieces, names, grips, rng, fewest=2)


def _rope(rng: np.random.Generator) -> Shape:
    """A cord in gentle bends on the table, of one to three lengths."""
    radius = rng.uniform(0.008, 0.014)
    length = rng.uniform(0.4, 0.8)
    count = 24
    heading = np.cumsum(rng.normal(0.0, 0.16, count)) + rng.uniform(-0.1, 0.1) * np.arange(count)
    heading = np.clip(heading, -1.3, 1.3)
    steps = np.stack([np.cos(heading), np.sin(heading)], axis=1) * length / count
    path = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    path -= path.mean(axis=0)
    nodes = [(float(x), float(y), radius) for x, y in path]
    pieces: list[Capsule | Block] = [Capsule(a, b, radius, radius) for a, b in pairwise(nodes)]
    lengths = int(rng.integers(1, 4))
    borders = np.sort(rng.uniform(0.25, 0.75, lengths - 1)) if lengths < 3 else np.array([0.33, 0.67])
    names = [f"length {np.searchsorted(borders, (k + 0.5) / count)}" for k in range(count)]
    return _assembled("rope", "rope", pieces, names, [nodes[0], nodes[-1], nodes[count // 2]], rng)


def _cloth(rng: np.random.Generator) -> Shape:
    """A towel or a round cloth, of one to three strips, with waves a few millimetres high."""
    half = (float(rng.uniform(0.12, 0.24)), float(rng.uniform(0.1, 0.18)))
    corner = float(rng.choice([0.0, 0.1, 1.0], p=[0.5, 0.25, 0.25]))
    strips = int(rng.choice([1, 2, 3], p=[0.5, 0.3, 0.2]))
    borders = half[0] * np.linspace(-1.0, 1.0, strips + 1)[1:-1] * rng.uniform(0.8, 1.1)
    waves = np.column_stack(
        [
            rng.uniform(0.0005, 0.002, 3),
            rng.uniform(-25.0, 25.0, (3, 2)),
            rng.uniform(0.0, 2.0 * np.pi, 3),
        ]
    )
    body = Sheet(half, corner, float(rng.uniform(0.0008, 0.0016)), waves, [float(b) for b in borders])
    inset = 0.97 - 0.26 * corner
    signs = ((-1, -1), (1, 1), (-1, 1), (1, -1), (-1, 0), (1, 0), (0, -1), (0, 1))
    places = [(x * half[0], y * half[1], 0.0) for x, y in signs]
    grips = np.array(places) * [[inset if x and y else 0.97] for x, y in signs]
    return Shape("cloth", "sheet", body, grips, 2.0 * float(np.hypot(*half)))


_DRAWS: Mapping[ObjectClass, Callable[[np.random.Generator], Shape]] = {
    "plush": _plush,
    "cloth": _cloth,
    "rope": _rope,
    "foam": _foam,
    "bag": _bag,
    "mixed": _mixed,
}


def _assembled(
    object_class: ObjectClass,
    shape_class: ShapeClass,
    pieces: Sequence[Capsule | Block],
    names: Sequence[str],
    grips: Sequence[tuple[float, float, float]],
    rng: np.random.Generator,
    fewest: int = 1,
) -> Shape:
    """The shape of named pieces; names are joined at random, so that an object has `fewest` to 5 parts."""
    kinds = list(dict.fromkeys(names))
    count = int(rng.integers(min(fewest, len(kinds)), min(5, len(kinds)) + 1))
    # ropes and layered blocks are joined with their neighbours, others with anything
    ordered = object_class in ("rope", "foam")
    if ordered:
        group = np.arange(len(kinds)) * count // len(kinds)
    else:
        group = np.concatenate([np.arange(count), rng.integers(0, count, len(kinds) - count)])
        group[1:] = rng.permutation(group[1:]) if count > 1 else 0
    used = {int(g): k for k, g in enumerate(dict.fromkeys(group.tolist()))}
    labels = [used[int(group[kinds.index(name)])] for name in names]
    return _whole(object_class, shape_class, Solid(pieces, labels), pieces, grips)


def _whole(
    object_class: ObjectClass,
    shape_class: ShapeClass,
    body: Body,
    pieces: Sequence[Capsule | Block],
    grips: Sequence[tuple[float, float, float]],
) -> Shape:
    corners = np.stack([piece.box() for piece in pieces])
    extent = corners[:, 1].max(axis=0) - corners[:, 0].min(axis=0)
    return Shape(object_class, shape_class, body, np.array(grips, np.float64), float(extent.max()))
