"""Where the points of an object are first seen."""

import numpy as np
from jaxtyping import Float64

from model.types import Array, Observation


def first_places(observation: Observation) -> Float64[Array, "N 3"]:
    """Where each point is in the first frame [m]; NaN for one that is never seen.

    One that is hidden at first is put where it is first seen, less how far its neighbours have moved by then.
    """
    points: Float64[Array, "T N 3"] = observation.points.astype(np.float64)
    seen = np.isfinite(points[..., 0])
    places: Float64[Array, "N 3"] = points[0].copy()
    known = np.flatnonzero(seen[0])
    for i in np.flatnonzero(~seen[0] & seen.any(0)):
        frame = int(seen[:, i].argmax())
        both = known[seen[frame, known]]
        if not len(both):
            places[i] = points[frame, i]
            continue
        near = both[np.argsort(np.linalg.norm(points[frame, both] - points[frame, i], axis=1))[:4]]
        places[i] = points[frame, i] - (points[frame, near] - points[0, near]).mean(0)
    return places
