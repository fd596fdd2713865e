"""Features on Gaussians → a connected partition."""

import numpy as np
from jaxtyping import Float32, Float64, Int
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.csgraph import connected_components

from model.errors import InputError
from model.neighbourhood import neighbourhood_graph
from model.spectral import spectral_clusters
from model.types import Array, Features, Gaussians, Parts

SMOOTHING_ROUNDS = 1
"""How often features are averaged over neighbours: stripes and seams are not parts."""
VOTING_ROUNDS = 2


def segment_parts(
    gaussians: Gaussians, features: Features, count: int = 5, seed: int = 0, min_share: float = 0.03
) -> Parts:
    """Partition the Gaussians into connected parts.

    Normalised cuts on the graph of touching Gaussians cut at necks (few edges cross) and where features
    change. Loose pieces then join the neighbour they are most like, parts that are too small dissolve, and
    the largest are cut again until there are `count`, if the object is large enough.

    Args:
        gaussians: The object.
        features: On the Gaussians.
        count: How many parts are wanted.
        seed: Of the clustering.
        min_share: Least share of the Gaussians in a part, 0..1.

    Returns:
        Parts in order of size, the largest first; `count` says how many were found.

    Raises:
        InputError: count or share make no sense, or features and Gaussians differ in number.
    """
    if count < 1:
        raise InputError(f"number of parts must be at least 1, not {count}")
    if not 0.0 <= min_share < 1.0:
        raise InputError(f"least share of a part must be in [0, 1), not {min_share}")
    if len(features.values) != len(gaussians):
        raise InputError(f"{len(features.values)} features for {len(gaussians)} Gaussians: lift them again")
    graph = neighbourhood_graph(gaussians.means)
    values = _smooth(graph, features.values)
    least = max(1, int(np.ceil(min_share * len(gaussians))))
    partition = _Partition(graph, gaussians.means, values, least, seed)
    labels = partition.tidy(partition.cut(np.arange(len(gaussians)), count))
    labels = partition.refine(labels, count)
    order = np.argsort(-np.bincount(labels), kind="stable")
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    found = len(order)
    warnings = (f"{count} parts were asked for, the object supports {found}",) if found < count else ()
    return Parts(labels=rank[labels].astype(np.int32), count=found, warnings=warnings)


def _smooth(graph: csr_matrix, values: Float32[Array, "G D"]) -> Float64[Array, "G D"]:
    """Mean over neighbours, several times."""
    edges = graph.copy()
    edges.data = np.ones_like(edges.data)
    edges = edges + diags(np.ones(graph.shape[0]))
    average = diags(1.0 / np.asarray(edges.sum(axis=1)).ravel()) @ edges
    smooth: Float64[Array, "G D"] = values.astype(np.float64)
    for _ in range(SMOOTHING_ROUNDS):
        smooth = average @ smooth
    return smooth


class _Partition:
    """The graph with what is needed to cut, clean and merge labels on it."""

    def __init__(
        self,
        graph: csr_matrix,
        points: Float32[Array, "G 3"],
        values: Float64[Array, "G D"],
        least: int,
        seed: int,
    ) -> None:
        self.graph, self.points, self.values = graph, points, values
        self.least, self.seed = least, seed
        edges = graph.tocoo()
        self.source, self.target = edges.row.astype(np.int64), edges.col.astype(np.int64)

    def cut(self, nodes: Int[Array, " n"], count: int) -> Int[Array, " n"]:
        """Clusters of some of the nodes, which must be connected."""
        inside = self.graph[nodes][:, nodes]
        points, values = self.points[nodes], self.values[nodes]
        return spectral_clusters(inside, points, values, count, self.seed)

    def tidy(self, labels: Int[Array, " G"]) -> Int[Array, " G"]:
        """Vote at the borders, keep one piece per label, dissolve what is too small."""
        for _ in range(VOTING_ROUNDS):
            labels = self._vote(labels)
        labels = self._pieces(labels)
        while labels.max() > 0:
            sizes = np.bincount(labels)
            smallest = int(np.argmin(sizes))
            if sizes[smallest] >= self.least:
                break
            labels = self._merge(labels, smallest)
        return labels

    def refine(self, labels: Int[Array, " G"], count: int) -> Int[Array, " G"]:
        """Merge or cut until there are `count` parts, or nothing is left that can be cut."""
        while labels.max() + 1 > count:
            labels = self._merge(labels, int(np.argmin(np.bincount(labels))))
        whole: set[int] = set()
        while labels.max() + 1 < count:
            sizes = np.bincount(labels)
            able = [part for part in np.argsort(-sizes, kind="stable") if int(part) not in whole]
            if not able or sizes[able[0]] < 2 * self.least:
                break
            largest = int(able[0])
            split = self._split(labels, largest)
            if split is None:
                whole.add(largest)
            else:
                labels = split
        return labels

    def _split(self, labels: Int[Array, " G"], part: int) -> Int[Array, " G"] | None:
        """One part cut in two connected halves of sufficient size; None if that fails."""
        nodes = np.flatnonzero(labels == part)
        halves = self.cut(nodes, 2)
        tried = labels.copy()
        tried[nodes[halves == 1]] = labels.max() + 1
        tried = self.tidy(tried)
        return tried if tried.max() > labels.max() else None

    def _vote(self, labels: Int[Array, " G"]) -> Int[Array, " G"]:
        """Every node takes the label most of its neighbours have (its own counts twice)."""
        size = (len(labels), int(labels.max()) + 1)
        votes = coo_matrix(
            (np.ones(len(self.source)), (self.source, labels[self.target])), shape=size
        ).toarray()
        votes[np.arange(len(labels)), labels] += 2.0
        winner: Int[Array, " G"] = votes.argmax(axis=1)
        return winner

    def _pieces(self, labels: Int[Array, " G"]) -> Int[Array, " G"]:
        """The connected pieces of all labels, numbered from 0."""
        same = labels[self.source] == labels[self.target]
        kept = (self.source[same], self.target[same])
        graph = coo_matrix((np.ones(int(same.sum())), kept), shape=self.graph.shape)
        pieces: Int[Array, " G"] = connected_components(graph, directed=False)[1].astype(np.int64)
        return pieces

    def _merge(self, labels: Int[Array, " G"], part: int) -> Int[Array, " G"]:
        """Give one part to the adjacent one that it is most like, per shared edge and overall."""
        border = (labels[self.source] == part) & (labels[self.target] != part)
        other = labels[self.target[border]]
        shared = np.bincount(other, minlength=int(labels.max()) + 1)
        mean = self.values[labels == part].mean(axis=0)
        scale = float(self.values.std(axis=0).max()) + 1e-12
        score = np.full(len(shared), -np.inf)
        for neighbour in np.flatnonzero(shared):
            difference = float(np.linalg.norm(self.values[labels == neighbour].mean(axis=0) - mean))
            score[neighbour] = np.log(shared[neighbour]) - difference / scale
        merged = np.where(labels == part, int(np.argmax(score)), labels)
        return np.unique(merged, return_inverse=True)[1]
