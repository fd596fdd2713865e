"""Fewer points of a spring network: which, how heavy, how joined, how stiff."""

from itertools import permutations

import numpy as np
from jaxtyping import Float, Float32, Float64, Int, Int32, Int64
from scipy.optimize import lsq_linear
from scipy.sparse import coo_matrix, csr_matrix, diags, vstack
from scipy.sparse.csgraph import connected_components, dijkstra

from model.errors import InputError
from model.types import Array, Topology

LIGHTEST = 0.5
"""The lightest point weighs at least this share of the median: light ones would set the time step of all."""
REACH = 1.75
"""Springs that skip a neighbour are up to this many usual distances long: they resist bending."""
EVEN = 0.05
"""How much an even stiffness per strain counts beside the energy."""
LEAST = 0.02
"""The softest spring over the mean, per strain."""
_PAIRS = [(i, j, k, m) for i in range(3) for j in range(i, 3) for k in range(j, 3) for m in range(k, 3)]
"""The 15 different components of a fully symmetric tensor of fourth order."""
_OFTEN = np.sqrt([float(len(set(permutations(pair)))) for pair in _PAIRS])
"""How often each occurs, rooted, so that sums of squares are those of the whole tensor."""


def scatter(topology: Topology, count: int) -> tuple[Int64[Array, " n"], Int64[Array, " N"]]:
    """Points that lie far apart along the springs, and for each point which of them is nearest to it.

    Returns:
        The chosen points in ascending order, and the place among them of each point's nearest.

    Raises:
        InputError: springs join the points to at least as many pieces: none would have two.
    """
    graph = _graph(topology)
    pieces, _ = connected_components(graph, directed=False)
    if count <= pieces:
        raise InputError(f"--points {count}: this twin is in {pieces} pieces: give more points than that")
    held = np.unique(topology.controller_springs[:, 1]).astype(np.int64)
    first = np.array([np.argmax(np.linalg.norm(_centred(topology), axis=1))])
    everywhere = np.arange(len(topology.points))
    chosen, spacing = _farthest(graph, first, everywhere, count, 0.0)
    if len(held):  # again, now held points first, as far apart as all of them will be
        left = count - (pieces - 1)  # every piece needs one
        held, _ = _farthest(graph, held[:1], held, left, spacing)
        chosen, _ = _farthest(graph, held, everywhere, count, 0.0)
    kept = np.sort(chosen)
    _, _, source = dijkstra(graph, indices=kept, min_only=True, return_predecessors=True)
    place = np.full(len(topology.points), -1, np.int64)
    place[kept] = np.arange(len(kept))
    return kept, place[source]


def _farthest(
    graph: csr_matrix, chosen: Int64[Array, " m"], among: Int64[Array, " k"], count: int, closest: float
) -> tuple[Int64[Array, " n"], float]:
    """More points along the graph, farthest first, until `count` or nearer than `closest` [m]; how near."""
    nearest = dijkstra(graph, indices=chosen, min_only=True)
    points = chosen.tolist()
    while len(points) < count and nearest[among].max() > closest:
        points.append(int(among[np.argmax(nearest[among])]))
        np.minimum(nearest, dijkstra(graph, indices=points[-1]), out=nearest)
    return np.array(points, np.int64), float(nearest[among].max())


def coarse_mass(
    topology: Topology, kept: Int64[Array, " n"], owner: Int64[Array, " N"]
) -> Float32[Array, " n"]:
    """Masses [kg] with the total, the first and, where none gets too light, the second moments of all points.

    Each kept point gets what is nearest to it, times a polynomial of its place, of the least change.
    """
    mass = topology.mass.astype(np.float64)
    places = _centred(topology) / max(float(np.abs(_centred(topology)).max()), 1e-12)
    own = np.bincount(owner, mass, minlength=len(kept))
    own = np.maximum(own, LIGHTEST * np.median(own))
    for degree in (2, 1, 0):
        powers = _powers(places, degree)
        missing = mass @ powers - own @ powers[kept]
        change = np.linalg.lstsq((own[:, None] * powers[kept]).T @ powers[kept], missing, rcond=1e-9)[0]
        shared = own * (1.0 + powers[kept] @ change)
        if shared.min() > 0.5 * LIGHTEST * np.median(own):
            break
    result: Float32[Array, " n"] = shared.astype(np.float32)
    return result


def coarse_springs(
    topology: Topology, kept: Int64[Array, " n"], owner: Int64[Array, " N"]
) -> Int32[Array, "E 2"]:
    """Kept points are joined where springs join what is nearest to them, and to the next within reach."""
    ends = owner[topology.springs.astype(np.int64)]
    ends = ends[ends[:, 0] != ends[:, 1]]
    count = len(kept)
    step = csr_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    step = step + step.T
    near = coo_matrix(step)
    places = topology.points[kept].astype(np.float64)

    def length(rows: Int[Array, " e"], columns: Int[Array, " e"]) -> Float64[Array, " e"]:
        return np.asarray(np.linalg.norm(places[rows] - places[columns], axis=1), np.float64)

    usual = float(np.median(length(near.row, near.col)))
    two = coo_matrix(step @ step)
    past = length(two.row, two.col) <= REACH * usual
    pairs = np.concatenate([np.stack([near.row, near.col], 1), np.stack([two.row, two.col], 1)[past]])
    pairs = np.unique(np.sort(pairs, axis=1), axis=0)
    return pairs[pairs[:, 0] < pairs[:, 1]].astype(np.int32)


def match_stiffness(
    topology: Topology,
    stiffness: Float32[Array, " F"],
    kept: Int64[Array, " n"],
    owner: Int64[Array, " N"],
    springs: Int32[Array, "E 2"],
) -> Float64[Array, " E"]:
    r"""Stiffness [N/m] with which affine deformations have the energy that they had, around every kept point.

    An affine strain ε gives a spring the energy $\frac12 kL^2 (n\cdot\varepsilon n)^2$, so that springs with
    the same $\sum kL^2\,n\otimes n\otimes n\otimes n$ have the same energy for all of them. Half of each
    spring counts at either end. Solved by least squares without negative stiffness, an even stiffness per
    strain deciding what that leaves open.
    """
    places = topology.points.astype(np.float64)
    wanted = _tensors(places, topology.springs, stiffness * topology.rest_length.astype(np.float64))
    target = np.zeros((len(kept), len(_PAIRS)))
    for side in (0, 1):
        np.add.at(target, owner[topology.springs[:, side]], 0.5 * wanted)
    each = _tensors(places[kept], springs, np.ones(len(springs)))
    blocks, size = [], len(springs)
    for part in range(len(_PAIRS)):
        rows = np.concatenate([springs[:, 0], springs[:, 1]])
        columns = np.tile(np.arange(size), 2)
        values = np.tile(0.5 * each[:, part], 2)
        blocks.append(csr_matrix((values, (rows, columns)), shape=(len(kept), size)))
    usual = float(target[:, _TRACE].sum() / each[:, _TRACE].sum())
    weight = float(np.sqrt((each**2).sum(axis=1).mean())) * EVEN**0.5
    system = vstack([*blocks, diags(np.full(size, weight))]).tocsr()
    wish = np.concatenate([target.T.ravel() / usual, np.full(size, weight)])
    found = usual * lsq_linear(system, wish, bounds=(LEAST, np.inf), tol=1e-3, max_iter=15).x
    length = np.linalg.norm(places[kept][springs[:, 0]] - places[kept][springs[:, 1]], axis=1)
    return np.asarray(found / length, np.float64)


_TRACE = [index for index, pair in enumerate(_PAIRS) if pair[0] == pair[1] and pair[2] == pair[3]]


def _tensors(
    places: Float64[Array, "m 3"], springs: Int[Array, "E 2"], strength: Float[Array, " E"]
) -> Float64[Array, "E 15"]:
    """Y L n⊗n⊗n⊗n of each spring, Y its stiffness per strain [N]; weighed by how often they occur."""
    apart = places[springs[:, 1]] - places[springs[:, 0]]
    length = np.maximum(np.linalg.norm(apart, axis=1), 1e-12)
    axis = apart / length[:, None]
    parts = np.stack([np.prod(axis[:, list(pair)], axis=1) for pair in _PAIRS], axis=1)
    tensors: Float64[Array, "E 15"] = (strength * length)[:, None] * parts * _OFTEN
    return tensors


def _graph(topology: Topology) -> csr_matrix:
    """Springs as lengths, both ways."""
    first, second = topology.springs.T
    places, count = topology.points.astype(np.float64), len(topology.points)
    length = np.maximum(np.linalg.norm(places[first] - places[second], axis=1), 1e-9)
    graph = csr_matrix((length, (first, second)), shape=(count, count))
    return graph + graph.T


def _centred(topology: Topology) -> Float64[Array, "N 3"]:
    mass = topology.mass.astype(np.float64)
    places = topology.points.astype(np.float64)
    centred: Float64[Array, "N 3"] = places - mass @ places / mass.sum()
    return centred


def _powers(places: Float64[Array, "N 3"], degree: int) -> Float64[Array, "N p"]:
    """1; x, y, z; and their products, up to a degree."""
    columns = [np.ones(len(places))]
    if degree > 0:
        columns += [places[:, i] for i in range(3)]
    if degree > 1:
        columns += [places[:, i] * places[:, j] for i in range(3) for j in range(i, 3)]
    return np.stack(columns, axis=1)
