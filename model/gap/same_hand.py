"""Whether the hand of a recording is the one that a twin came with, and where it leads the twin."""

import numpy as np
from jaxtyping import Float, Float64
from scipy.spatial import cKDTree

from model.gap.bodies.grip import held_places
from model.gap.bodies.hand import steadied
from model.gap.graph import Graph
from model.gap.matter import ONE_HAND
from model.types import Array, Observation

SAME_HAND = 2.0
"""Spacings: controllers that start this near to the twin's are the twin's."""
FAR, NEAR = 2.0, 1.0
"""Grasps: controllers of a twin go with others where none of either is farther than the first from all of the
other, and none of the others than the second: so far from where it is led a hand holds something else."""
RECORDED = 0.025
"""A twin's own recorded motion is of this recording if it is nowhere farther [m] from where the hand leads: a
diagnosis may have found the hand a centimetre elsewhere along each axis."""


def led(
    graph: Graph, grasp: float, recorded: Float[Array, "T C 3"] | None, observation: Observation
) -> Float64[Array, "F C 3"] | None:
    """Where the controllers of a twin are in each frame of a recording [m]; None: another hand holds it.

    They are those of the recording, as many and in the same places; or others that go with these, as those of
    a twin that a diagnosis made, which has one at each point that is held.

    Args:
        graph: Of the twin.
        grasp: How much of it a hand holds at once [m].
        recorded: Motion that the twin came with [m]; None: it has none.
        observation: As it lies on the twin.
    """
    if not len(graph.grip):
        return None
    hand, own = observation.controllers[0].astype(np.float64), graph.controllers
    if hand.shape == own.shape and np.linalg.norm(hand - own, axis=1).max() <= SAME_HAND * graph.spacing:
        return steadied(observation.controllers, observation.times)
    if not len(hand) or max(_away(hand, own), _away(own, hand)) > FAR * grasp:
        return None
    steady = steadied(observation.controllers, observation.times)
    carried = held_places(steady, own, ONE_HAND * grasp)
    if recorded is not None and recorded.shape == carried.shape:
        known = recorded.astype(np.float64)
        if np.linalg.norm(known - carried, axis=-1).max() <= RECORDED:
            return known
    return carried if _away(hand, own) <= NEAR * grasp else None


def _away(some: Float64[Array, "C 3"], others: Float64[Array, "D 3"]) -> float:
    """How far the farthest of some is from the nearest of others [m]."""
    return float(cKDTree(others).query(some)[0].max())
