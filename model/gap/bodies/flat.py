"""What lies so low on the ground that it has no inside: a cloth, whatever it looks like elsewhere."""

import numpy as np

from model.gap.bodies.rest import rest_places
from model.gap.size import size_of
from model.types import Observation

LOW = 0.05
"""Of its size: nearly all that is seen of a cloth that is spread out is no higher above the ground."""
NEARLY = 0.95


def lies_flat(observation: Observation) -> bool:
    """Whether the object lies on the ground in the first frame and is nowhere thick; not without a ground.

    A cloth that hangs in a bundle is as thick as a solid is. In another recording it may lie spread out.
    """
    ground = observation.ground_height
    places = rest_places(observation)
    places = places[np.isfinite(places[:, 0])]
    if ground is None or len(places) < 3:
        return False
    high = float(np.quantile(places[:, 2], NEARLY)) - ground
    return high < LOW * size_of(places)
