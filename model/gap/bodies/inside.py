"""Where a solid is, by points of its surface: nobody says which way is out, and one side may be unseen."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from model.gap.bodies.neighbours import covering_points
from model.types import Array

NEIGHBOURS = 6
"""To which the distance says how blunt a surface element is."""
LOOSE = 0.5
"""How far the surface may be missed, against how uneven its elements may be."""
MOST = 400
"""Points that are asked: the work grows with the third power."""


@dataclass(frozen=True)
class Inside:
    """A function that is about one inside of a surface, one half on it, and zero outside.

    Gauss's formula makes it of surface elements; these are unknown, and are the smallest by which it is one
    half at all points of the surface. Between the legs of a toy, and in the hole of a ring, it is near zero,
    though the surface is all around.

    Reference:
        Lin, Xiao, Shi and Wang (2022), Surface reconstruction from point clouds without normals by
        parametrizing the Gauss formula, ACM Transactions on Graphics 42 (2), equations 6 to 10.
    """

    places: Float64[Array, "N 3"]
    """Points of the surface [m]."""
    elements: Float64[Array, "N 3"]
    """Area times normal of each [m²]."""
    blunt: float
    """Distance below which an element does not come nearer [m]."""

    @classmethod
    def of(cls, places: Float64[Array, "N 3"]) -> "Inside":
        """The surface through these points [m]."""
        if len(places) > MOST:
            places = places[covering_points(places, MOST)]
        near = cKDTree(places).query(places, k=min(NEIGHBOURS + 1, len(places)))[0][:, 1:]
        blunt = max(float(np.median(near.mean(1))), 1e-9)
        flux = _flux(places, places, blunt).reshape(len(places), -1)
        gram = flux @ flux.T
        gram[np.diag_indices_from(gram)] *= 1.0 + LOOSE
        elements = flux.T @ np.linalg.solve(gram, np.full(len(places), 0.5))
        return cls(places, elements.reshape(-1, 3), blunt)

    def __call__(self, points: Float64[Array, "P 3"]) -> Float64[Array, " P"]:
        """How much each point is inside."""
        share: Float64[Array, " P"] = np.einsum(
            "pnk,nk->p", _flux(points, self.places, self.blunt), self.elements
        )
        return share


def _flux(
    points: Float64[Array, "P 3"], places: Float64[Array, "N 3"], blunt: float
) -> Float64[Array, "P N 3"]:
    """Through an element of unit area at each place, of what is sent out evenly by each point."""
    way = places[None] - points[:, None]
    distance = np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), blunt)
    flux: Float64[Array, "P N 3"] = way / (4.0 * np.pi * distance**3)
    return flux
