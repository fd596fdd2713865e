"""The clip that the project makes itself: a hand lifts a plush animal by one leg."""

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import click
import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float32, Float64, UInt8

from model.backdrops import shade
from model.errors import InputError
from model.formats.files import check_writable, replacing
from model.formats.movie import encode_mp4
from model.rendering.splat import SplatRenderer
from model.rotations import matrices
from model.scenes.hand import hand_coat
from model.scenes.plush import GRIP, plush_coat, plush_topology
from model.scenes.splats import Coat, joined, lit
from model.scenes.table import table_view
from model.simulator.build import build_simulator
from model.simulator.simulator import Simulator
from model.skinning import Skin
from model.types import Array, Camera, Gaussians, Topology
from model.views import look_at

FRAMES, FPS = 60, 30.0
STIFFNESS, GRIP_STIFFNESS = 55.0, 60.0
"""Of springs and of the grip's springs [N/m]."""
DAMPING, DRAG, FRICTION = 0.012, 0.8, 0.7
"""[N·s/m], [1/s], [1]."""
GRIP_REACH = 0.019
"""The hand holds the points this close to the middle of the paw [m]."""
SETTLING, SETTLING_DRAG = 30, 12.0
"""Frames in which the animal comes to rest before the clip begins, and the drag [1/s] that helps."""
NOISE = 1.6 / 255
"""Standard deviation of the sensor's noise."""
WAY = (
    (0.00, 0, 0, 0),
    (0.17, 0, 0, 0),
    (0.90, -0.045, -0.010, 0.135),
    (1.45, 0.055, -0.020, 0.150),
    (2.00, 0.000, -0.010, 0.120),
)
"""Where the hand goes: time [s] and displacement x, y, z [m]."""


@dataclass(frozen=True)
class DemoScene:
    """Everything that the clip shows, before it is filmed."""

    camera: Camera
    plush: Coat
    topology: Topology
    hand: Coat
    """Around the origin, which is where it pinches."""
    points: Float32[Array, "T N 3"]
    """[m]."""
    grip: Float64[Array, "T 3"]
    """Where the hand pinches [m]."""


def make_demo_clip(path: Path, seed: int = 0, truth_dir: Path | None = None) -> None:
    """Film a hand that lifts a plush animal by one leg: 640×480, 2 s; equal seeds give equal bytes.

    Args:
        path: The MP4 to write, whole or not at all.
        seed: For textures, the jitter of the samples and the sensor's noise.
        truth_dir: Where to write `camera.json`, `controllers.npz`, `object/NNNN.png` and `hand/NNNN.png`,
            if anywhere.

    Raises:
        InputError: nothing can be written there.
    """
    check_writable(path)
    rng = np.random.default_rng(seed)
    scene = act(set_scene(rng))
    pictures, object_masks, hand_masks = [], [], []
    for picture, thing, hand in film(scene, rng, masks=truth_dir is not None):
        pictures.append(picture)
        object_masks.append(thing)
        hand_masks.append(hand)
    with replacing(path) as temporary:
        temporary.write_bytes(encode_mp4(pictures, np.arange(len(pictures)) / FPS))
    if truth_dir is not None:
        _write_truth(truth_dir, scene, object_masks, hand_masks)


def set_scene(rng: np.random.Generator) -> DemoScene:
    """The animal and the hand in one frame, before anything moves."""
    camera = look_at(np.array([0.03, -0.54, 0.58]), np.array([0.005, 0.075, 0.03]), 610.0, 640, 480)
    plush = plush_coat(rng)
    topology = _held(plush_topology(plush, rng))
    return DemoScene(camera, plush, topology, hand_coat(rng), topology.points[None], GRIP[None])


def act(scene: DemoScene) -> DemoScene:
    """The scene with the lift: let the animal come to rest in the still hand, then move the hand."""
    grip = GRIP + _way(np.arange(FRAMES) / FPS)
    controls = scene.topology.controller_points + (grip - GRIP)[:, None]
    with torch.no_grad():
        settled = _simulator(scene.topology, SETTLING_DRAG).rollout(frames=SETTLING, fps=FPS).end
        start = replace(settled, velocities=torch.zeros_like(settled.velocities))
        moved = _simulator(scene.topology, DRAG).rollout(start, controls.astype(np.float32), fps=FPS)
    return replace(scene, points=moved.points.numpy(), grip=grip)


def _held(topology: Topology) -> Topology:
    """The animal with springs from four corners of the grip to every point within it."""
    corners = 0.008 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) + GRIP
    within = np.flatnonzero(np.linalg.norm(topology.points - GRIP, axis=1) < GRIP_REACH)
    pairs = np.stack(np.meshgrid(np.arange(4), within, indexing="ij"), axis=-1).reshape(-1, 2)
    length = np.linalg.norm(corners[pairs[:, 0]] - topology.points[pairs[:, 1]], axis=1)
    return replace(
        topology,
        controller_points=corners.astype(np.float32),
        controller_springs=pairs.astype(np.int32),
        controller_rest_length=length.astype(np.float32),
    )


def _way(times: Float64[Array, " T"]) -> Float64[Array, "T 3"]:
    """Displacement of the hand [m]: smooth between the stops of `WAY`."""
    stops = np.array(WAY)
    place = np.clip(np.searchsorted(stops[:, 0], times, side="right") - 1, 0, len(stops) - 2)
    share = (times - stops[place, 0]) / (stops[place + 1, 0] - stops[place, 0])
    eased = (share**2 * (3 - 2 * share))[:, None]
    moved: Float64[Array, "T 3"] = stops[place, 1:] + eased * (stops[place + 1, 1:] - stops[place, 1:])
    return moved


def _simulator(topology: Topology, drag_rate: float) -> Simulator:
    return build_simulator(
        points=topology.points,
        mass=topology.mass,
        springs=topology.springs,
        rest_length=topology.rest_length,
        stiffness=STIFFNESS,
        controller_springs=topology.controller_springs,
        controller_rest_length=topology.controller_rest_length,
        controller_stiffness=GRIP_STIFFNESS,
        controller_points=topology.controller_points,
        dashpot_damping=DAMPING,
        drag_rate=drag_rate,
        friction=FRICTION,
        ground_height=0.0,
    )


def film(
    scene: DemoScene, rng: np.random.Generator, masks: bool
) -> Iterator[tuple[UInt8[Array, "H W 3"], Bool[Array, "H W"], Bool[Array, "H W"]]]:
    """Picture, visible object and visible hand of every frame; empty masks unless asked for."""
    background, on_table = table_view(scene.camera, rng)
    skin = Skin(scene.plush.gaussians, scene.topology)
    both = joined(scene.plush, scene.hand)
    count = len(scene.plush.gaussians)
    labels = np.zeros((len(both.gaussians), 3), np.float32)
    labels[:count, 0], labels[count:, 1] = 1, 1
    on_surface = np.linalg.norm(scene.plush.normals, axis=1, keepdims=True)
    for points, grip in zip(scene.points, scene.grip, strict=True):
        with torch.no_grad():
            body, turned = skin(torch.as_tensor(points))
        means = np.concatenate([body.numpy(), scene.hand.gaussians.means + grip]).astype(np.float32)
        quaternions = np.concatenate([turned.numpy(), scene.hand.gaussians.quaternions])
        # Discs were laid with their third axis along the normal.
        normals = np.concatenate([matrices(turned)[..., 2].numpy() * on_surface, scene.hand.normals])
        moved = replace(both.gaussians, means=means, quaternions=quaternions)
        shaded = shade(background, means, moved.volumes, 0.0, scene.camera)
        shaded = background + on_table[..., None] * (shaded - background)
        color, alpha = _rendered(moved, lit(moved.colors, normals, means), scene.camera)
        picture = color + (1 - alpha[..., None]) * shaded + rng.normal(0, NOISE, color.shape)
        seen = _rendered(moved, labels, scene.camera)[0] if masks else np.zeros_like(color)
        yield (picture.clip(0, 1) * 255 + 0.5).astype(np.uint8), seen[..., 0] > 0.5, seen[..., 1] > 0.5


def _rendered(
    gaussians: Gaussians, colors: Float32[Array, "G 3"], camera: Camera
) -> tuple[Float32[Array, "H W 3"], Float32[Array, "H W"]]:
    """Premultiplied colour and alpha."""
    tensors = (gaussians.means, gaussians.scales, gaussians.quaternions, gaussians.opacities, colors)
    with torch.no_grad():
        image = SplatRenderer()(*(torch.as_tensor(array) for array in tensors), camera)
    return image.color.numpy(), image.alpha.numpy()


def _write_truth(
    folder: Path, scene: DemoScene, things: list[Bool[Array, "H W"]], hands: list[Bool[Array, "H W"]]
) -> None:
    """Camera and controllers in the forms that `--camera` and `--controllers` read, and the masks."""
    camera = scene.camera
    record = {
        "intrinsics": camera.intrinsics.tolist(),
        "width": camera.width,
        "height": camera.height,
        "world_from_camera": camera.world_from_camera.tolist(),
        "ground_height": 0.0,
    }
    with replacing(folder / "camera.json") as temporary:
        temporary.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    motion = scene.topology.controller_points + (scene.grip - GRIP)[:, None]
    with replacing(folder / "controllers.npz") as temporary:
        np.savez(temporary, controllers=motion, times=np.arange(len(motion)) / FPS)
    for name, masks in (("object", things), ("hand", hands)):
        for frame, mask in enumerate(masks):
            _, png = cv2.imencode(".png", mask.astype(np.uint8) * 255)
            with replacing(folder / name / f"{frame:04d}.png") as temporary:
                temporary.write_bytes(png.tobytes())


@click.command()
@click.argument("path", type=click.Path(path_type=Path))
@click.option("--seed", default=0, show_default=True, help="For textures and noise.")
@click.option("--truth", type=click.Path(path_type=Path), help="Folder for the true camera, hand and masks.")
def main(path: Path, seed: int, truth: Path | None) -> None:
    """Film the demo clip to PATH."""
    try:
        make_demo_clip(path, seed, truth)
    except InputError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(2)
    click.echo(f"filmed {path}: {FRAMES} frames, 640×480")


if __name__ == "__main__":
    main()
