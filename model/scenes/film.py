"""A case → a film of it: one view of a body in its materials, the hands that hold it, and what is where."""

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float32, Int, UInt8

from model.errors import InputError
from model.rendering.base import Rendering
from model.rendering.splat import SplatRenderer
from model.scenes.carried import carried
from model.scenes.case import Case
from model.scenes.film_files import write_film
from model.scenes.grasp import Hand, hands_of
from model.scenes.looks.base import Finish, Look
from model.scenes.looks.dress import Dress, dress
from model.scenes.looks.light import lit
from model.scenes.looks.paint import draw_look, wardrobe
from model.scenes.looks.setting import Setting
from model.scenes.looks.viewpoint import draw_camera
from model.scenes.splats import together
from model.types import Array, Camera, Gaussians
from model.views import scaled

SKIN = Finish(specular=0.05, gloss=0.2, wrap=0.2)
"""Of hands and sleeves."""
HAND_SPACING = (0.0036, 0.006)
"""Of the discs of a hand [m]."""
HIDDEN = 0.010
"""A point this much behind what is rendered there [m] is not seen."""
FINENESS = 0.24
"""Discs along the diagonal of the body, per pixel along the longer side of the film."""
FINEST, COARSEST = 0.001, 0.008
"""Spacing of discs [m]."""
AVERTED = -0.25
"""Cosine between outward and the way to the camera below which nothing is drawn."""
ALOFT = 1.0
"""Height above a ground that is not there [m]."""
HALF = 0.5
"""Alpha from which on a pixel belongs to something."""


@dataclass(frozen=True)
class Scene:
    """Everything that a film shows, before it is filmed."""

    case: Case
    camera: Camera
    setting: Setting
    looks: tuple[Look, ...]
    """Per part."""
    body: Dress
    hands: tuple[Hand, ...]


@dataclass(frozen=True)
class Shot:
    """One frame."""

    picture: UInt8[Array, "H W 3"]
    object: Bool[Array, "H W"]
    """Where the object is seen, and the hands are not."""
    hand: Bool[Array, "H W"]
    visible: Bool[Array, " N"]
    """Which observed points the camera sees."""


def film_case(case: Case, folder: Path, size: tuple[int, int] = (640, 480), seed: int = 0) -> Path:
    """Film a case; equal cases, sizes and seeds give equal files.

    All films of an object show the same object: its look follows from its name.
    What is written is described in `docs/scenes.md`.

    Args:
        case: With Gaussians and `complete`; its camera, where it has one, is the film's.
        folder: Where the files go; made if it is not there.
        size: Width and height of the film [px]; with the case's own camera, the longer side alone counts.
        seed: For lamps, tables, cameras and the noise of the sensor.

    Returns:
        The film.

    Raises:
        InputError: the case has no Gaussians or no complete motion, or nothing can be written there.
    """
    scene = set_scene(case, size, seed)
    shots = list(shoot(scene, _rng(case.name, seed, "sensor")))
    assert case.complete is not None  # set_scene has asked
    return write_film(
        folder,
        case,
        camera=scene.camera,
        seed=seed,
        materials=tuple(look.material for look in scene.looks),
        pictures=[shot.picture for shot in shots],
        objects=np.stack([shot.object for shot in shots]),
        hands=np.stack([shot.hand for shot in shots]),
        visible=np.stack([shot.visible for shot in shots]),
    )


def set_scene(case: Case, size: tuple[int, int], seed: int) -> Scene:
    """Choose looks, camera, lamp and table, dress the object, and put the hands on it.

    Raises:
        InputError: the case has no Gaussians or no complete motion.
    """
    if case.gaussians is None or case.complete is None or not len(case.topology.binding_index):
        raise InputError(f"case {case.name}: a film needs its Gaussians and the motion of all its points")
    threads, stage = wardrobe(case.object_name), _rng(case.name, seed, "stage")
    looks = tuple(draw_look(material, threads) for material in materials_of(case))
    labels = case.topology.part[case.topology.binding_index[:, 0]]
    diagonal = float(np.linalg.norm(np.ptp(case.gaussians.means, axis=0)))
    spacing = float(np.clip(diagonal / (FINENESS * max(size)), FINEST, COARSEST))
    body = dress(case.gaussians, labels, looks, spacing, threads, known=case.rest)
    happens = np.concatenate([case.complete.reshape(-1, 3), case.observation.controllers.reshape(-1, 3)])
    camera = draw_camera(happens, size, stage) if case.camera is None else scaled(case.camera, max(size))
    setting = Setting.draw(stage)
    outside = body.outward.any(axis=1)
    surface = body.gaussians.means[outside], body.outward[outside]
    fine = float(np.clip(spacing, *HAND_SPACING))
    hands = hands_of(case.observation.controllers, *surface, camera, stage, fine)
    return Scene(case, camera, setting, looks, body, tuple(hands))


def materials_of(case: Case) -> list[int]:
    """What each part is made of: the truth, or the likeliest."""
    if case.truth is not None:
        return [int(material) for material in case.truth.material]
    return [int(prior.distribution.argmax()) for prior in case.priors]


def shoot(scene: Scene, rng: np.random.Generator) -> Iterator[Shot]:
    """The frames, one after another."""
    case, camera, setting = scene.case, scene.camera, scene.setting
    ground = case.observation.ground_height
    background, on_table = setting.empty(camera, case.rest.mean(axis=0), ground, rng)
    cast = together(scene.body.gaussians, *(hand.coat.gaussians for hand in scene.hands))
    lamp, body_count = setting.light, len(scene.body.gaussians)
    tags = np.zeros((len(cast), 3), np.float32)
    tags[:body_count, 0], tags[body_count:, 1] = 1, 1
    finishes = [*(look.finish for look in scene.looks), SKIN]
    label = np.concatenate([scene.body.label, np.full(len(cast) - body_count, len(scene.looks))])
    for frame, (body, turned, turns) in enumerate(carried(case, scene.body.gaussians)):
        played = [hand.at(frame) for hand in scene.hands]
        means = np.concatenate([body, *(hand[0] for hand in played)])
        quaternions = np.concatenate([turned, *(hand[1] for hand in played)])
        normals, outward = (
            np.concatenate([np.einsum("gij,gj->gi", turns, own), *(hand[2] for hand in played)])
            for own in (scene.body.normals, scene.body.outward)
        )
        views = camera.position - means
        views /= np.linalg.norm(views, axis=1, keepdims=True)
        # What looks away is behind something, unless its side of a thin sheet is drawn over the other.
        front = (outward * views).sum(axis=1) > AVERTED
        moved = _some(replace(cast, means=means, quaternions=quaternions), front)
        heights = moved.means[:, 2] - ground if ground is not None else np.full(len(moved), ALOFT)
        colors = lit(moved.colors, normals[front], views[front], heights, finishes, label[front], lamp)
        empty = setting.shaded(background, on_table, means, cast.volumes, ground, camera)
        image, tagged = _rendered(moved, colors, camera), _rendered(moved, tags[front], camera)
        alpha = image.alpha.numpy()[..., None]
        picture = setting.sensor.expose(image.color.numpy() + (1 - alpha) * empty, rng)
        shares = tagged.color.numpy()
        thing, hand = shares[..., 0] > HALF, shares[..., 1] > HALF
        assert case.complete is not None
        visible = seen_points(case.complete[frame], thing, tagged.depth.numpy(), camera)
        yield Shot(picture, thing, hand, visible)


def seen_points(
    points: Float32[Array, "N 3"],
    thing: Bool[Array, "H W"],
    depth: Float32[Array, "H W"],
    camera: Camera,
) -> Bool[Array, " N"]:
    """Points that lie on the object where it is seen, and not behind its front."""
    pixels, reach = camera.project(points)
    place: Int[Array, "N 2"] = np.round(pixels).astype(np.int64)
    inside = (place >= 0).all(axis=1) & (place < [camera.width, camera.height]).all(axis=1) & (reach > 0)
    x, y = np.where(inside[:, None], place, 0).T
    seen: Bool[Array, " N"] = inside & thing[y, x] & (reach < depth[y, x] + HIDDEN)
    return seen


def _some(gaussians: Gaussians, chosen: Bool[Array, " G"]) -> Gaussians:
    return Gaussians(
        means=gaussians.means[chosen],
        scales=gaussians.scales[chosen],
        quaternions=gaussians.quaternions[chosen],
        opacities=gaussians.opacities[chosen],
        colors=gaussians.colors[chosen],
        volumes=gaussians.volumes[chosen],
    )


def _rendered(gaussians: Gaussians, colors: Float32[Array, "G 3"], camera: Camera) -> Rendering:
    tensors = (gaussians.means, gaussians.scales, gaussians.quaternions, gaussians.opacities, colors)
    with torch.no_grad():
        image: Rendering = SplatRenderer(0.01)(*(torch.as_tensor(array) for array in tensors), camera)
    return image


def _rng(name: str, seed: int, purpose: str) -> np.random.Generator:
    """Numbers that follow from a name and a seed."""
    digest = hashlib.sha256(f"{name}/{seed}/{purpose}".encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:8], "little"))
