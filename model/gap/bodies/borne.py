"""Whether what is seen of an object is borne from below, by an inside that nobody sees.

One camera sees one side of a solid, and that is as thin as a cloth. But a cloth at rest hangs from hands, or
lies on the ground: between them its weight bends it upward at its rims, as a hammock. What bulges upward well
above the ground, where no hand is, pushes from below, unless a taut fold of it between two hands bears it, as
a line does what hangs over it.
"""

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from model.gap.bodies.tension import STANDS, unsupported
from model.gap.bodies.unheld import off_the_ground, unheld
from model.gap.size import size_of
from model.types import Array, Observation

BORNE = 0.1
"""Share of the points that bulge upward, less those that sag, of what is borne. One camera's views of six
solids that lie, and of six cloths, by a generator of another hand: 0.18 to 0.49, and 0."""
PATCH = 14
"""Points, with itself, whose curvature tells how the surface bends at a point."""
LEVEL = 0.5
"""Looked at is what faces up or down by such a cosine at least, off the ground and where no hand is near."""
BENT = 0.3
"""Curvature over that of a ball as large as the object, below which a patch is flat but for noise."""


def is_borne(observation: Observation, places: Float64[Array, "N 3"]) -> bool:
    """Whether more of it bulges than sags, where only its inside can bear it: no tension holds that up.

    Args:
        observation: Whose ground and hands count.
        places: Points on the object in the first frame, at rest [m].
    """
    ground, size = observation.ground_height, size_of(places)
    if ground is None or len(places) < PATCH or size <= 0.0:
        return False
    middles, curvature = _upward(places)
    loose = unheld(observation, places) & off_the_ground(places, ground)
    asked = loose & (np.abs(middles) > LEVEL)
    limit = 2.0 * BENT / size
    up, down = (asked & (side * curvature > limit) for side in (-1.0, 1.0))
    weighs = np.asarray(observation.gravity, np.float64)
    if up.mean() - down.mean() <= BORNE or not weighs.any():
        return False
    return unsupported(places, loose, weighs) > STANDS


def _upward(places: Float64[Array, "N 3"]) -> tuple[Float64[Array, " N"], Float64[Array, " N"]]:
    """The upward part of the normal at each point, and mean curvature as seen from above [1/m].

    A quadratic function of the place in its plane is fitted to each patch; what bulges upward is negative.
    """
    near = places[cKDTree(places).query(places, k=PATCH)[1]]
    own = near - near.mean(1, keepdims=True)
    axes = np.linalg.svd(own, full_matrices=False)[2]
    axes[:, 2] *= np.where(axes[:, 2, 2:] < 0.0, -1.0, 1.0)
    u, v, height = (own @ axes.swapaxes(1, 2)).transpose(2, 0, 1)
    columns = np.stack([np.ones_like(u), u, v, u**2, u * v, v**2], -1)
    found = (np.linalg.pinv(columns) @ height[..., None])[..., 0]
    return axes[:, 2, 2], found[:, 3] + found[:, 5]
