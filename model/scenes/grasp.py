"""Hands at the controllers of a case: which there are, how they come in, how they move."""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float, Float32, Float64, Int
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from model.rotations import multiply, nearest_rotations
from model.scenes.hand import SKIN, SLEEVE, SLEEVE_SPACING, SPACING, hand_coat, upper_arm
from model.scenes.splats import Coat, joined
from model.types import Array, Camera, Gaussians

ONE_HAND = 0.09
"""Controllers of one hand are no farther from the next than this [m]."""
RIGID = 0.004
"""Distances between controllers of one hand change by less than this [m]."""
PINCH = 0.008
"""How deep fingertips sink into what they hold, at most [m]."""
LOOSE = 0.004
"""How far from the surface a hand may be said to hold [m]."""
UPPER_SPACING = 0.016
"""Between the discs of the upper arm [m]."""
YAWS, PITCHES = 16, (-0.35, 0.15, 0.6)
"""In how many directions a hand may come in, and how steeply, beyond its own slope [rad]."""
SKINS = (1.0, 0.82, 0.6, 0.42)
"""Brightness of people's skin, over the hand's own."""


BARE = 0.5
"""Share of people in short sleeves."""
SLEEVES = (
    (0.20, 0.22, 0.30), (0.46, 0.46, 0.48), (0.80, 0.79, 0.76), (0.16, 0.26, 0.20), (0.36, 0.11, 0.14),
)  # fmt: skip


@dataclass(frozen=True)
class Hand:
    """One hand in all frames."""

    coat: Coat
    """At rest: where it is in frame 0."""
    turns: Float64[Array, "T 3 3"]
    shifts: Float64[Array, "T 3"]
    """A point p of it is at turn (p - middle) + middle + shift."""
    middle: Float64[Array, " 3"]
    """Of its controllers in frame 0 [m]."""

    def at(self, frame: int) -> tuple[Float32[Array, "G 3"], Float32[Array, "G 4"], Float32[Array, "G 3"]]:
        """Means [m], quaternions and normals in a frame."""
        turn, gaussians = self.turns[frame], self.coat.gaussians
        means = (gaussians.means - self.middle) @ turn.T + self.middle + self.shifts[frame]
        normals = self.coat.normals @ turn.T
        return means.astype(np.float32), _turned(gaussians, turn), normals.astype(np.float32)


def hands_of(
    controllers: Float32[Array, "T C 3"],
    surface: Float[Array, "P 3"],
    normals: Float[Array, "P 3"],
    camera: Camera,
    rng: np.random.Generator,
    spacing: float = SPACING,
) -> list[Hand]:
    """The hands that hold a body, each from where it hides the least.

    Args:
        controllers: Where they hold [m].
        surface: Points of the body's surface in frame 0 [m].
        normals: Outward, unit.
        camera: The view.
        rng: For the look of the hand.
        spacing: Between its Gaussians [m].
    """
    if controllers.shape[1] == 0:
        return []
    group = hand_groups(controllers)
    lower = hand_coat(rng, spacing, max(SLEEVE_SPACING, 1.5 * spacing))
    plain = joined(lower, upper_arm(rng, UPPER_SPACING))
    toned = _dressed(plain, rng)
    placed: list[Hand] = []
    others: list[Float64[Array, "n 3"]] = []
    for number in range(int(group.max()) + 1):
        held = controllers[:, group == number].astype(np.float64)
        middle = held[0].mean(axis=0)
        pivot = touching(middle, surface, normals)
        turns, shifts = _followed(held)
        right = camera.project(pivot[None])[0][0, 0] >= camera.width / 2 or group.max() == 0
        coat = toned if right else _mirrored(toned)
        turn = _approach(coat, pivot, surface, others, camera)
        laid = _laid(coat, turn, pivot)
        others.append(laid.gaussians.means[:: max(1, len(coat.gaussians) // 2300)].astype(np.float64))
        placed.append(Hand(laid, turns, shifts, middle))
    return placed


def _dressed(plain: Coat, rng: np.random.Generator) -> Coat:
    """Somebody's skin, and their sleeve, unless it is pushed up."""
    skin = SKIN * SKINS[int(rng.integers(len(SKINS)))]
    bare, dye = rng.random() < BARE, np.array(SLEEVES[int(rng.integers(len(SLEEVES)))])
    colors = plain.gaussians.colors.astype(np.float64)
    covered = colors[:, 2:] > colors[:, :1]  # the hand's own sleeve is blue
    folds = colors.mean(axis=1, keepdims=True) / SLEEVE.mean()
    worn = np.where(covered, skin if bare else folds * dye, colors * (skin / SKIN))
    return Coat(replace(plain.gaussians, colors=np.clip(worn, 0, 1).astype(np.float32)), plain.normals)


def hand_groups(controllers: Float32[Array, "T C 3"]) -> Int[Array, " C"]:
    """Which hand each controller belongs to, from 0 on: those that are near and keep their distances."""
    apart = np.linalg.norm(controllers[:, :, None] - controllers[:, None], axis=3)
    joined = (apart[0] < ONE_HAND) & (np.ptp(apart, axis=0) < RIGID)
    groups: Int[Array, " C"] = connected_components(csr_matrix(joined), directed=False)[1]
    return groups


def touching(
    grip: Float64[Array, " 3"], surface: Float[Array, "P 3"], normals: Float[Array, "P 3"]
) -> Float64[Array, " 3"]:
    """The grip, moved so that the fingertips touch the surface and do not drown in it."""
    _, index = cKDTree(surface).query(grip)
    nearest, normal = surface[index].astype(np.float64), normals[index].astype(np.float64)
    height = float((grip - nearest) @ normal)
    moved: Float64[Array, " 3"] = nearest + np.clip(height, -PINCH, LOOSE) * normal
    return moved


def _followed(held: Float64[Array, "T C 3"]) -> tuple[Float64[Array, "T 3 3"], Float64[Array, "T 3"]]:
    """The rigid motion of controllers since frame 0 (Kabsch): turns about their middle, and its way."""
    middle = held.mean(axis=1)
    around = held - middle[:, None]
    spread = np.einsum("tci,cj->tij", around, around[0])
    # Unturned about what the fingers do not span.
    spread += (1e-6 * float((around[0] ** 2).sum()) + 1e-12) * np.eye(3)
    left, _, right = np.linalg.svd(spread)
    sign = np.ones((len(held), 3))
    sign[:, 2] = np.linalg.det(left @ right)
    return left * sign[:, None, :] @ right, middle - middle[0]


def _approach(
    coat: Coat,
    pivot: Float64[Array, " 3"],
    surface: Float[Array, "P 3"],
    others: list[Float64[Array, "n 3"]],
    camera: Camera,
) -> Float64[Array, "3 3"]:
    """The turn of the hand that puts the least of it inside the body, in its view, or into another hand."""
    hand = coat.gaussians.means[:: max(1, len(coat.gaussians) // 1500)].astype(np.float64)
    hand = hand[np.linalg.norm(hand, axis=1) < 0.45]
    arm = hand[np.linalg.norm(hand, axis=1) > 0.035]
    tree = cKDTree(surface[::3])
    obstacles = cKDTree(np.concatenate(others)) if others else None
    pixels = camera.project(surface[::3])[0]
    image = cKDTree(pixels)
    near = 0.02 * camera.width
    depth = camera.project(surface[::3])[1]
    best, least = np.eye(3), np.inf
    for yaw in 2 * np.pi * np.arange(YAWS) / YAWS:
        for pitch in PITCHES:
            turn = _about(2, yaw) @ _about(0, pitch)
            there = arm @ turn.T + pivot
            clash = float((tree.query(there)[0] < 0.012).mean())
            seen, reach = camera.project(there)
            away, index = image.query(seen)
            hides = float(((away < near) & (reach < depth[index])).mean())
            crowd = float((obstacles.query(there)[0] < 0.03).mean()) if obstacles is not None else 0.0
            under = float((there[:, 2] < pivot[2] - 0.02).mean())
            # Among equals, an arm that comes from where people sit or stand: the far side or the sides.
            towards = turn @ np.array([0.0, 0.8, 0.6])
            facing = float(towards[:2] @ camera.forward[:2])
            score = 3 * clash + hides + 2 * crowd + 2 * under - 0.15 * facing
            if score < least:
                best, least = turn, score
    return best


def _laid(coat: Coat, turn: Float64[Array, "3 3"], pivot: Float64[Array, " 3"]) -> Coat:
    means = (coat.gaussians.means @ turn.T + pivot).astype(np.float32)
    laid = replace(coat.gaussians, means=means, quaternions=_turned(coat.gaussians, turn))
    return Coat(laid, (coat.normals @ turn.T).astype(np.float32))


def _mirrored(coat: Coat) -> Coat:
    """A left hand."""
    flip = np.array([-1, 1, 1], np.float32)
    # A mirror image of a Gaussian with axes R is one with axes F R F: y and z of its quaternion change sign.
    quaternions = coat.gaussians.quaternions * np.array([1, 1, -1, -1], np.float32)
    mirrored = replace(coat.gaussians, means=coat.gaussians.means * flip, quaternions=quaternions)
    return Coat(mirrored, coat.normals * flip)


def _turned(gaussians: Gaussians, turn: Float64[Array, "3 3"]) -> Float32[Array, "G 4"]:
    own = torch.as_tensor(gaussians.quaternions, dtype=torch.float64)
    both = multiply(nearest_rotations(torch.as_tensor(turn)[None]).expand_as(own), own)
    return both.numpy().astype(np.float32)


def _about(axis: int, angle: float) -> Float64[Array, "3 3"]:
    one, other = [(1, 2), (2, 0), (0, 1)][axis]
    turn = np.eye(3)
    turn[one, one] = turn[other, other] = np.cos(angle)
    turn[one, other], turn[other, one] = -np.sin(angle), np.sin(angle)
    return turn
