"""The spring graph of a twin, as it is or coarser."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from model.bundle import TwinBundle
from model.formats.parameters import scalar
from model.gap.bodies.neighbours import farthest_points
from model.types import Array

FINER = 1.08
"""Points are thinned out by growing their distance by this factor until they are few enough."""


@dataclass(frozen=True)
class Graph:
    """Points, springs and the springs of the hand, in float64."""

    points: Float64[Array, "P 3"]
    """[m]."""
    mass: Float64[Array, " P"]
    """[kg]."""
    springs: Int64[Array, "E 2"]
    rest_length: Float64[Array, " E"]
    """[m]."""
    stiffness: Float64[Array, " E"]
    """[N/m]."""
    damping: float
    """Of every spring [N·s/m]."""
    controllers: Float64[Array, "C 3"]
    """At rest [m]."""
    grip: Int64[Array, "S 2"]
    """(controller, point)."""
    grip_length: Float64[Array, " S"]
    """[m]."""
    grip_stiffness: Float64[Array, " S"]
    """[N/m]."""

    @classmethod
    def of(cls, bundle: TwinBundle) -> "Graph":
        """The graph of a twin, without springs of the hand that have no stiffness: these hold nothing."""
        topology, parameters = bundle.topology, bundle.parameters
        holds = parameters.controller_stiffness > 0.0
        return cls(
            topology.points.astype(np.float64),
            topology.mass.astype(np.float64),
            topology.springs.astype(np.int64),
            topology.rest_length.astype(np.float64),
            parameters.stiffness.astype(np.float64),
            scalar(parameters, "dashpot_damping", 0.0),
            topology.controller_points.astype(np.float64),
            topology.controller_springs[holds].astype(np.int64),
            topology.controller_rest_length[holds].astype(np.float64),
            parameters.controller_stiffness[holds].astype(np.float64),
        )

    @property
    def lengths(self) -> Float64[Array, " E"]:
        """Of the springs where the points are [m]."""
        return _apart(self.points, self.springs)

    @property
    def spacing(self) -> float:
        """Median length of a spring [m]."""
        return float(np.median(self.lengths))

    def within(self, most: int) -> tuple["Graph", Int64[Array, " P"]]:
        """The graph itself, or a coarser one of at most so many points; and the point each point became.

        Points are merged into the nearest one that stays; those of which members were joined are joined.
        Mass is kept, and so are the sums of k L² and γ L² over the springs, which a uniform strain feels;
        strain at rest is that of the springs around.
        """
        if len(self.points) <= most:
            return self, np.arange(len(self.points))
        kept = _thinned(self.points, self.spacing, most)
        became = cKDTree(self.points[kept]).query(self.points)[1].astype(np.int64)
        joined = np.sort(became[self.springs], axis=1)
        springs = np.unique(joined[joined[:, 0] != joined[:, 1]], axis=0)
        points, count = self.points[kept], len(kept)
        lengths = _apart(points, springs)
        degree = np.bincount(springs.ravel(), minlength=count)
        share = _at_points(self.springs, self.stiffness * self.lengths**2, became, count) / degree.clip(1)
        strain = _at_points(self.springs, self.rest_length / self.lengths, became, count)
        strain /= _at_points(self.springs, np.ones(len(self.springs)), became, count).clip(1e-12)
        energy = 0.5 * share[springs].sum(1)
        energy *= (self.stiffness * self.lengths**2).sum() / energy.sum()
        coarse = Graph(
            points,
            np.bincount(became, self.mass, minlength=count),
            springs,
            lengths * strain[springs].mean(1),
            energy / lengths**2,
            self.damping * float((self.lengths**2).sum() / (lengths**2).sum()),
            self.controllers,
            *self._regripped(points, became),
        )
        return coarse, became

    def _regripped(
        self, points: Float64[Array, "p 3"], became: Int64[Array, " P"]
    ) -> tuple[Int64[Array, "s 2"], Float64[Array, " s"], Float64[Array, " s"]]:
        """The springs of the hand on coarser points: those that fall together become one, as stiff as all."""
        if not len(self.grip):
            return self.grip, self.grip_length, self.grip_stiffness
        moved = np.stack([self.grip[:, 0], became[self.grip[:, 1]]], 1)
        grip, which = np.unique(moved, axis=0, return_inverse=True)
        which = which.reshape(-1)
        slack = self.grip_length - _reach(self.controllers, self.points, self.grip)
        count = np.bincount(which)
        length = _reach(self.controllers, points, grip) + np.bincount(which, slack) / count
        return grip, length.clip(0.0), np.bincount(which, self.grip_stiffness)


def _apart(points: Float64[Array, "P 3"], springs: Int64[Array, "E 2"]) -> Float64[Array, " E"]:
    lengths: Float64[Array, " E"] = np.linalg.norm(points[springs[:, 1]] - points[springs[:, 0]], axis=1)
    return lengths.clip(1e-9)


def _reach(
    controllers: Float64[Array, "C 3"], points: Float64[Array, "P 3"], grip: Int64[Array, "S 2"]
) -> Float64[Array, " S"]:
    reach: Float64[Array, " S"] = np.linalg.norm(controllers[grip[:, 0]] - points[grip[:, 1]], axis=1)
    return reach


def _thinned(points: Float64[Array, "P 3"], spacing: float, most: int) -> Int64[Array, " p"]:
    apart = spacing * (len(points) / most) ** (1 / 3) / FINER**10
    while len(kept := farthest_points(points, apart)) > most:
        apart *= FINER
    return kept


def _at_points(
    springs: Int64[Array, "E 2"], values: Float64[Array, " E"], became: Int64[Array, " P"], count: int
) -> Float64[Array, " p"]:
    """Sum over the springs of the members of each point; a spring counts at both ends."""
    both = np.concatenate([became[springs[:, 0]], became[springs[:, 1]]])
    return np.bincount(both, np.concatenate([values, values]), minlength=count)
