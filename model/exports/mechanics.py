"""A twin as plain numbers: what every export to a simulator is written from."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float32, Float64, Int64

from model.formats.parameters import gravity, ground_height, scalar
from model.types import Array, Trajectory

if TYPE_CHECKING:
    from model.bundle import TwinBundle

FPS = 30.0
"""Frames per second of a twin whose clip's rate is unknown."""
PALE = np.float32(0.5)
"""Colour of a point that no Gaussian follows."""


@dataclass(frozen=True)
class Mechanics:
    """Points, edges between nodes, and how the hand moves; nodes are the points, then the controllers."""

    points: Float64[Array, "N 3"]
    """At rest [m]."""
    mass: Float64[Array, " N"]
    """[kg]."""
    controllers: Float64[Array, "C 3"]
    """At rest [m]."""
    edges: Int64[Array, "E 2"]
    """Pairs of nodes: springs between points, then from points to controllers."""
    rest_length: Float64[Array, " E"]
    """[m]."""
    stiffness: Float64[Array, " E"]
    """[N/m]."""
    spring_count: int
    """How many of the edges join two points."""
    dashpot_damping: float
    """Of every edge [N·s/m]."""
    drag_rate: float
    """[1/s]."""
    friction: float
    restitution: float
    collision_distance: float
    """[m]; 0: points pass through each other."""
    bending_decay: float
    """Rate at which zigzags between neighbouring points die out [1/s]."""
    gravity: tuple[float, float, float]
    """[m/s²]."""
    ground_height: float | None
    """z of the ground [m]; None: no ground."""
    times: Float64[Array, " T"]
    """Of the frames [s]."""
    controls: Float64[Array, "T C 3"]
    """Where the controllers are in every frame [m]."""
    substeps: int
    """Per frame: what the stability of this twin under this motion asks for, with a margin."""

    @property
    def interval(self) -> float:
        """Time between frames [s]."""
        return float(self.times[1] - self.times[0]) if len(self.times) > 1 else 1.0 / FPS

    @property
    def step(self) -> float:
        """Substep [s]."""
        return self.interval / self.substeps

    @property
    def needed(self) -> float:
        """The longest substep that is stable [s]: without the margin."""
        from model.simulator.pace import MARGIN

        return MARGIN * self.interval / max(self.substeps, 1)


def mechanics_of(twin: "TwinBundle") -> Mechanics:
    """The twin without its effects, with as many substeps as its recorded motion takes.

    Raises:
        InputError: the motion diverges, or a parameter is not one number.
    """
    topology, parameters = twin.topology, twin.parameters
    plain = replace(twin, effects=())
    rollout = roll(plain)
    times, substeps = rollout.times, int(rollout.metadata["substeps_per_frame"])
    if len(times) < 2:  # it has not moved, and may be about to
        substeps = plain.simulator().needed_substeps(1.0 / FPS)
    held = twin.topology.controller_points.astype(np.float64)
    still = np.repeat(held[None], len(times), axis=0)
    grips = topology.controller_springs.astype(np.int64)
    grips = np.stack([grips[:, 1], len(topology.points) + grips[:, 0]], axis=1)

    def both(springs: Float32[Array, " s"], grips: Float32[Array, " g"]) -> Float64[Array, " e"]:
        return np.concatenate([springs, grips]).astype(np.float64)

    return Mechanics(
        points=topology.points.astype(np.float64),
        mass=topology.mass.astype(np.float64),
        controllers=held,
        edges=np.concatenate([topology.springs.astype(np.int64), grips]),
        rest_length=both(topology.rest_length, topology.controller_rest_length),
        stiffness=both(parameters.stiffness, parameters.controller_stiffness),
        spring_count=len(topology.springs),
        dashpot_damping=scalar(parameters, "dashpot_damping", 0.0),
        drag_rate=scalar(parameters, "drag_rate", 0.0),
        friction=scalar(parameters, "friction", 0.0),
        restitution=scalar(parameters, "restitution", 0.0),
        collision_distance=scalar(parameters, "collision_distance", 0.0),
        bending_decay=scalar(parameters, "bending_decay", 0.0),
        gravity=gravity(parameters),
        ground_height=ground_height(parameters),
        times=times,
        controls=still if twin.controls is None else twin.controls.astype(np.float64),
        substeps=max(1, substeps),
    )


def roll(twin: "TwinBundle") -> Trajectory:
    """The twin under its recorded motion; where its clip's rate is unknown, at `FPS`.

    Raises:
        InputError: as `TwinBundle.rollout` does.
    """
    if twin.manifest.source.fps is not None:
        return twin.rollout()
    frames = 1 + round(FPS) if twin.controls is None else len(twin.controls)
    return twin.rollout(times=np.arange(frames, dtype=np.float64) / FPS)


def point_colors(twin: "TwinBundle") -> Float64[Array, "N 3"]:
    """Colour of each point, 0..1: of the Gaussians that follow it, by how much they do."""
    index, weight = twin.topology.binding_index, twin.topology.binding_weight.astype(np.float64)
    count = len(twin.topology.points)
    shares = weight * twin.gaussians.opacities.astype(np.float64)[:, None]
    total = np.bincount(index.ravel(), shares.ravel(), minlength=count)
    colors = np.full((count, 3), PALE, np.float64)
    for channel in range(3):
        each = shares * twin.gaussians.visible_colors[:, channel, None]
        summed = np.bincount(index.ravel(), each.ravel(), minlength=count)
        np.divide(summed, total, out=colors[:, channel], where=total > 0)
    clipped: Float64[Array, "N 3"] = colors.clip(0.0, 1.0)
    return clipped


def point_radius(points: Float64[Array, "N 3"]) -> float:
    """Half the usual distance to the third neighbour [m]: such balls fill the object."""
    from scipy.spatial import cKDTree

    if len(points) < 2:
        return 0.01
    return float(0.5 * np.median(cKDTree(points).query(points, min(4, len(points)))[0][:, -1])) or 0.01
