"""Small twins of three shapes, carried by their recorded hand: a sheet, a rope, a solid."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np

from model.bundle import TwinBundle
from model.schema import BundleManifest
from model.types import Gaussians, Parameter, Parameters, Topology

FPS, FRAMES = 30.0, 31


def sheet(ground: bool = False, size: int = 9) -> TwinBundle:
    """A sheet of `size` × `size` points that hangs by two corners, or is thrown on the ground flat."""
    places = _grid((size, size, 1), 0.03)
    corners = [0, size - 1]
    return _twin("sheet", places, reach=1.6, stiffness=12.0, mass=0.06, held=corners, ground=ground)


def rope(ground: bool = False, size: int = 20) -> TwinBundle:
    """A rope of four strands that is carried by one end, or falls."""
    places = _grid((size, 2, 2), 0.02)
    return _twin("rope", places, reach=2.3, stiffness=40.0, mass=0.05, held=[0, 1, 2, 3], ground=ground)


def solid(ground: bool = False, size: int = 5, restitution: float = 0.2) -> TwinBundle:
    """A block of `size`³ points that is carried by one edge, or falls."""
    places = _grid((size, size, size), 0.03)
    edge = [size**2 * i + size - 1 for i in range(size)]
    block = _twin("solid", places, reach=1.8, stiffness=60.0, mass=0.2, held=edge, ground=ground)
    entries = {**block.parameters.globals, "restitution": Parameter(restitution, "1", "user")}
    return replace(block, parameters=replace(block.parameters, globals=entries))


SHAPES: dict[str, Callable[..., TwinBundle]] = {"sheet": sheet, "rope": rope, "solid": solid}


def _grid(shape: tuple[int, int, int], spacing: float) -> np.ndarray:
    """Points of a grid, each a little off, as those of an object from a video are."""
    places = spacing * np.array(list(product(*(range(count) for count in shape))), np.float64)
    return places + np.random.default_rng(4).uniform(-0.1, 0.1, places.shape) * spacing


def _twin(
    name: str,
    places: np.ndarray,
    reach: float,
    stiffness: float,
    mass: float,
    held: list[int],
    ground: bool,
) -> TwinBundle:
    """The twin; above the ground it is let go of, away from it it is held."""
    rng, count = np.random.default_rng(5), len(places)
    points = (places + np.array([0.0, 0.0, 0.06])).astype(np.float32)
    apart = np.linalg.norm(points[:, None] - points, axis=-1)
    spacing = float(np.median(np.sort(apart, axis=1)[:, 1]))
    springs = np.argwhere(np.triu(apart < reach * spacing, 1)).astype(np.int32)
    hands = np.zeros(0, np.int32) if ground else np.array(held, np.int32)
    controllers = points[hands] + np.float32([0.0, 0.0, 0.01])
    grips = np.stack([np.arange(len(hands), dtype=np.int32), hands], axis=1)
    values = {
        "dashpot_damping": (0.02, "N*s/m"),
        "drag_rate": (1.5, "1/s"),
        "friction": (0.5, "1"),
        "restitution": (0.2, "1"),
    }
    values |= {"ground_height": (0.0, "m")} if ground else {}
    topology = Topology(
        points=points,
        mass=(mass / count * rng.uniform(0.8, 1.2, count)).astype(np.float32),
        springs=springs,
        rest_length=apart[springs[:, 0], springs[:, 1]].astype(np.float32),
        part=(points[:, 0] > points[:, 0].mean()).astype(np.int32),
        binding_index=np.arange(count, dtype=np.int32)[:, None],
        binding_weight=np.ones((count, 1), np.float32),
        controller_points=controllers,
        controller_springs=grips,
        controller_rest_length=np.full(len(hands), 0.01, np.float32),
    )
    manifest = {
        "schema": "matphys.twin/1",
        "id": name,
        "source": {"fps": FPS, "frames": FRAMES, "name": name},
    }
    return TwinBundle(
        manifest=BundleManifest.model_validate(manifest),
        gaussians=_gaussians(points, spacing),
        topology=topology,
        parameters=Parameters(
            stiffness=(stiffness * rng.uniform(0.7, 1.3, len(springs))).astype(np.float32),
            controller_stiffness=np.full(len(hands), 3 * stiffness, np.float32),
            globals={key: Parameter(value, unit, "user") for key, (value, unit) in values.items()},
        ),
        controls=None if ground else _carried(controllers),
    )


def _carried(controllers: np.ndarray) -> np.ndarray:
    """To the side and up and back, [T, C, 3]."""
    time = np.arange(FRAMES) / FPS
    way = np.stack([0.08 * np.sin(5 * time), 0.05 * (1 - np.cos(4 * time)), 0.06 * np.sin(3 * time) ** 2], -1)
    return (controllers + way[:, None]).astype(np.float32)


def _gaussians(points: np.ndarray, spacing: float) -> Gaussians:
    """A ball at every point, of the colour of its place."""
    count = len(points)
    colors = (points - points.min(axis=0)) / np.maximum(np.ptp(points, axis=0), 1e-6)
    size = np.float32(0.4 * spacing)
    return Gaussians(
        means=points.copy(),
        scales=np.full((count, 3), size, np.float32),
        quaternions=np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
        opacities=np.full(count, 0.9, np.float32),
        colors=colors.astype(np.float32),
        volumes=np.full(count, 4 / 3 * np.pi * size**3, np.float32),
    )
