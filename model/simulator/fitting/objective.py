"""The loss of a fit and its gradient, at a place of the search."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import torch
from jaxtyping import Float64
from torch import Tensor

from model.simulator.divergence import SimulationDiverged
from model.simulator.fitting.minimise import Vector
from model.simulator.fitting.scene import Scene
from model.simulator.fitting.target import Target
from model.simulator.fitting.unknown import Unknown
from model.simulator.pace import StabilityWarning
from model.simulator.simulator import Rollout

Apply: TypeAlias = Callable[[Scene, Mapping[str, Tensor]], Scene]
"""The scene with the unknowns, by name, at these values."""


@dataclass(frozen=True)
class Look:
    """How much of an interaction is looked at, and how finely."""

    horizon: int
    """Frames after frame 0."""
    substeps: int
    checkpoint: bool


class Objective:
    """Mean square residual per coordinate, in units of noise, with the priors as further residuals."""

    def __init__(
        self, scene: Scene, unknowns: Sequence[Unknown], target: Target, apply: Apply = Scene.with_values
    ) -> None:
        """See `fit`."""
        self.scene, self.unknowns, self.target, self._apply = scene, tuple(unknowns), target, apply

    @property
    def start(self) -> Vector:
        """Coordinates that the search begins at."""
        return np.concatenate([u.coordinates(u.start).reshape(-1).numpy() for u in self.unknowns])

    @property
    def limits(self) -> tuple[Vector, Vector]:
        """Bounds of the coordinates."""
        each = [np.full((u.size, 2), u.limits()) for u in self.unknowns]
        return np.concatenate(each)[:, 0], np.concatenate(each)[:, 1]

    def names(self) -> list[str]:
        """What each coordinate belongs to."""
        return [u.name for u in self.unknowns for _ in range(u.size)]

    def split(self, z: Float64[Tensor, " n"]) -> list[Float64[Tensor, "..."]]:
        """Coordinates of each unknown."""
        parts = torch.split(z, [u.size for u in self.unknowns])
        return [part.reshape(u.start.shape) for part, u in zip(parts, self.unknowns, strict=True)]

    def values(self, z: Vector) -> dict[str, Tensor]:
        """The free values by name, in their units."""
        parts = self.split(torch.from_numpy(z.copy()))
        return {u.name: u.values(part) for part, u in zip(parts, self.unknowns, strict=True)}

    def at(self, z: Float64[Tensor, " n"]) -> Scene:
        """The scene with the unknowns at these coordinates, on their graph."""
        parts = self.split(z)
        given = {u.name: u.apply(part) for part, u in zip(parts, self.unknowns, strict=True)}
        return self._apply(self.scene, given)

    def substeps(self, z: Vector, refine: float) -> int | None:
        """As many as stability asks for per frame at these coordinates, times `refine`; None: it diverges."""
        with torch.no_grad():
            try:
                needed = max(self.at(torch.from_numpy(z)).rollout(2).substeps)
            except SimulationDiverged:
                return None
        widest = np.diff(self.scene.times)
        return int(np.ceil(needed * refine * widest.max() / widest[0]))

    def evaluate(self, z: Vector, look: Look) -> tuple[float, Vector] | None:
        """Loss and gradient; None where either is not finite."""
        leaf = torch.from_numpy(z.copy()).requires_grad_()
        try:
            points = self.roll(self.at(leaf), look).points
        except SimulationDiverged:
            return None
        loss = self.loss(points, self.split(leaf))
        if not bool(torch.isfinite(loss)):
            return None
        (gradient,) = torch.autograd.grad(loss, leaf)
        if not bool(torch.isfinite(gradient).all()):
            return None
        return float(loss.detach()), gradient.numpy()

    def residuals(self, z: Vector, look: Look) -> Float64[np.ndarray, " m"] | None:
        """All that the loss sums the squares of; None where one is not finite."""
        leaf = torch.from_numpy(z.copy())
        with torch.no_grad():
            try:
                points = self.roll(self.at(leaf), look).points
            except SimulationDiverged:
                return None
            parts = [self.target.residuals(points).double().reshape(-1)]
            for unknown, part in zip(self.unknowns, self.split(leaf), strict=True):
                if unknown.prior is not None:
                    parts.append(unknown.slack(part).reshape(-1))
            found: Float64[np.ndarray, " m"] = torch.cat(parts).numpy()
        return found if np.isfinite(found).all() else None

    def count(self, look: Look) -> int:
        """What the sum of squares is divided by: coordinates that are seen."""
        return max(1, self.target.count(look.horizon + 1))

    def loss(self, points: Tensor, parts: Sequence[Tensor]) -> Tensor:
        """Of a trajectory [t, N, 3] and the coordinates that made it."""
        total = self.target.residuals(points).double().square().sum()
        for unknown, part in zip(self.unknowns, parts, strict=True):
            if unknown.prior is not None:
                total = total + unknown.slack(part).square().sum()
        return total / max(1, self.target.count(len(points)))

    @staticmethod
    def roll(scene: Scene, look: Look) -> Rollout:
        """With the substeps asked for, or as many as stability asks for along the way where that is more."""
        frames = look.horizon + 1
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", StabilityWarning)
                return scene.rollout(frames, substeps=look.substeps, checkpoint=look.checkpoint)
        except StabilityWarning:
            return scene.rollout(frames, checkpoint=look.checkpoint)
