"""Other springs between the same mass points: how many each point asks for, and how far it reaches."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import csr_matrix, identity
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from model.spring_graph import local_spacing
from model.topology import SHORTEST_GRIP
from model.types import Array, Topology

HOPS = 2
"""A new spring joins points that the topology's own springs join in so many steps: none jumps a gap."""
MOST = 64
"""Springs that a point may ask for."""


@dataclass(frozen=True)
class Wiring:
    """A rule for springs; lengths are in spacings, so that it fits every size."""

    neighbours: Float[Array, " R"]
    """Springs that a point of each region asks for."""
    reach: Float[Array, " R"]
    """How long they may be, over the local spacing of the point that asks."""
    grips: int
    """Springs per controller."""
    grip_reach: float
    """How long those may be, over the median spacing; each controller has at least one."""


class Wires:
    """The candidates for springs of a topology, from which a rule takes its own."""

    def __init__(self, topology: Topology, region: Int[Array, " P"]) -> None:
        """`region` says which entry of a rule each mass point obeys."""
        self.topology, self._region = topology, region
        points = topology.points.astype(np.float64)
        self._spacing = local_spacing(points)
        count = min(MOST + 1, len(points))
        distance, index = cKDTree(points).query(points, count)
        first = np.repeat(np.arange(len(points))[:, None], count, axis=1)
        joined = np.asarray(self._reachable()[first.ravel(), index.ravel()]).reshape(index.shape) > 0
        self._distance, self._index, self._first = distance, index, first
        self._usable = joined & (distance > 0.0)

    def rewire(self, wiring: Wiring) -> Topology:
        """The topology with springs by this rule, and its controllers' by it too.

        A spring is there when either end asks for it. Where the rule leaves loose pieces, the topology's own
        springs between them stay.
        """
        asks = self._usable & (self._distance <= (wiring.reach[self._region] * self._spacing)[:, None])
        asks &= np.cumsum(asks, axis=1) <= np.round(wiring.neighbours[self._region])[:, None]
        pairs = np.sort(np.stack([self._first[asks], self._index[asks]], axis=1), axis=1)
        springs = np.unique(np.concatenate([pairs, self._links(pairs)]), axis=0).astype(np.int32)
        return hold(with_springs(self.topology, springs), wiring.grips, wiring.grip_reach)

    def _links(self, pairs: Int[Array, "m 2"]) -> Int[Array, "l 2"]:
        """Own springs of the topology between pieces that `pairs` leaves loose."""
        own = np.sort(self.topology.springs, axis=1)
        graph = _graph(pairs, len(self.topology.points))
        label = connected_components(graph, directed=False)[1]
        return np.asarray(own[label[own[:, 0]] != label[own[:, 1]]])

    def _reachable(self) -> csr_matrix:
        count = len(self.topology.points)
        graph = _graph(self.topology.springs, count)
        step = reach = graph + graph.T + identity(count, format="csr", dtype=np.float32)
        for _ in range(HOPS - 1):
            reach = reach @ step
        return reach.tocsr()


def with_springs(topology: Topology, springs: Int[Array, "E 2"]) -> Topology:
    """The topology with these springs, at rest as it is."""
    ends = topology.points.astype(np.float64)[springs]
    length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    return replace(topology, springs=springs.astype(np.int32), rest_length=length.astype(np.float32))


def hold(topology: Topology, grips: int, reach: float) -> Topology:
    """The topology with other controller springs: to the nearest points within reach, at least to one.

    A controller that holds nothing in the topology, since it does not touch the object, holds nothing here.

    Args:
        topology: Its controllers are where they are in frame 0.
        grips: Springs per controller.
        reach: Over the median spacing.
    """
    if not len(topology.controller_points):
        return topology
    points = topology.points.astype(np.float64)
    spacing = float(np.median(local_spacing(points)))
    wanted = min(grips + 2, len(points))
    distance, index = cKDTree(points).query(topology.controller_points.astype(np.float64), wanted)
    distance, index = distance.reshape(-1, wanted), index.reshape(-1, wanted)
    long_enough = distance >= SHORTEST_GRIP * spacing  # a spring without length pushes nowhere
    held = long_enough & (distance <= reach * spacing)
    nearest = np.where(long_enough.any(axis=1), long_enough.argmax(axis=1), wanted - 1)
    held[np.arange(len(held)), nearest] = True
    held &= np.cumsum(held, axis=1) <= grips
    held &= np.isin(np.arange(len(held)), topology.controller_springs[:, 0])[:, None]
    owner = np.repeat(np.arange(len(held))[:, None], wanted, axis=1)
    pairs = np.stack([owner[held], index[held]], axis=1).astype(np.int32)
    return replace(
        topology, controller_springs=pairs, controller_rest_length=distance[held].astype(np.float32)
    )


def _graph(pairs: Int[Array, "m 2"], count: int) -> csr_matrix:
    ones = np.ones(len(pairs), np.float32)
    return csr_matrix((ones, (pairs[:, 0], pairs[:, 1])), shape=(count, count))
