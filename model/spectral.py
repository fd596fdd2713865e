"""Graph → compact clusters: normalised cuts on a coarsened graph."""

import cv2
import numpy as np
from jaxtyping import Float, Float64, Int
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.csgraph import dijkstra
from scipy.sparse.linalg import eigsh

from model.types import Array

CELL_COUNT = 1500
"""Size of the coarse graph on which the eigenvectors are found."""
AFFINITY_FLOOR = 1e-3
"""Affinity of the most different neighbours: even a sharp border still conducts a little."""
SPREAD_SHARE = 0.3
"""Differences between adjacent cells below this share of the spread of all features are no border."""
ATTEMPTS = 20
"""Runs of k-means, of which the best counts."""


def spectral_clusters(
    graph: csr_matrix,
    points: Float[Array, "N 3"],
    features: Float[Array, "N D"],
    count: int,
    seed: int,
) -> Int[Array, " N"]:
    """Cut a graph where few edges cross or where features change.

    The graph is coarsened to geodesic cells around evenly spread seeds; two cells conduct by the number of
    edges between them and the likeness of their mean features (relative to what is usual between adjacent
    cells, so that any encoder's units will do). The relaxed normalised cut embeds the cells and k-means reads
    the clusters off. (Choosing among several by the cut itself was tried: it slides the cut along a limb.)

    Args:
        graph: Connected, symmetric, edges weighted by length [m].
        points: Positions of its nodes [m].
        features: On its nodes.
        count: How many clusters to look for (fewer nodes than that: one cluster each).
        seed: Of k-means.

    Returns:
        Labels 0 … count-1; clusters may be empty or in several pieces.

    Reference:
        Shi & Malik (2000), Normalized cuts and image segmentation;
        Ng, Jordan & Weiss (2002), On spectral clustering.
    """
    if len(points) <= count:
        return np.arange(len(points))
    cell = _cells(graph, np.asarray(points, np.float64))
    affinity = _affinity(graph, cell, np.asarray(features, np.float64))
    if affinity.shape[0] <= count:
        return cell
    rows = _eigenvectors(affinity, count)
    rows = rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-12)
    clusters: Int[Array, " N"] = _k_means(rows, count, seed)[cell]
    return clusters


def _cells(graph: csr_matrix, points: Float64[Array, "N 3"]) -> Int[Array, " N"]:
    """Each node's nearest seed along the graph, the seeds chosen by farthest points."""
    if len(points) <= CELL_COUNT:
        return np.arange(len(points))
    seeds = np.empty(CELL_COUNT, np.int64)
    seeds[0] = np.argmax(((points - points.mean(axis=0)) ** 2).sum(axis=1))
    nearest = np.full(len(points), np.inf)
    for step in range(1, CELL_COUNT):
        np.minimum(nearest, ((points - points[seeds[step - 1]]) ** 2).sum(axis=1), out=nearest)
        seeds[step] = np.argmax(nearest)
    _, _, source = dijkstra(graph, directed=False, indices=seeds, min_only=True, return_predecessors=True)
    order = np.full(len(points), -1)
    order[seeds] = np.arange(CELL_COUNT)
    # Coincident points can be chosen twice; their numbering must stay gapless.
    return np.unique(order[source], return_inverse=True)[1]


def _affinity(graph: csr_matrix, cell: Int[Array, " N"], features: Float64[Array, "N D"]) -> csr_matrix:
    """How well adjacent cells conduct."""
    count = int(cell.max()) + 1
    member = coo_matrix((np.ones(len(cell)), (cell, np.arange(len(cell)))), shape=(count, len(cell))).tocsr()
    mean = (member @ features) / np.asarray(member.sum(axis=1))
    edges = graph.copy()
    edges.data = np.ones_like(edges.data)
    between = (member @ edges @ member.T).tocoo()
    apart = between.row != between.col
    row, column, edge_count = between.row[apart], between.col[apart], between.data[apart]
    difference = np.sqrt(((mean[row] - mean[column]) ** 2).sum(axis=1))
    if not len(difference):
        return between.tocsr()
    spread = float(np.sqrt(mean.var(axis=0).sum()))
    usual = max(float(np.quantile(difference, 0.75)), SPREAD_SHARE * spread, 1e-12)
    likeness = np.exp(-0.5 * (difference / usual) ** 2) + AFFINITY_FLOOR
    return coo_matrix((edge_count * likeness, (row, column)), shape=(count, count)).tocsr()


def _eigenvectors(affinity: csr_matrix, count: int) -> Float64[Array, "n k"]:
    """The first eigenvectors of the normalised Laplacian, the smoothest first."""
    degree = np.asarray(affinity.sum(axis=1)).ravel()
    scale = 1.0 / np.sqrt(np.maximum(degree, 1e-12))
    laplacian = diags(np.ones(len(degree))) - diags(scale) @ affinity @ diags(scale)
    if affinity.shape[0] <= 4 * count:
        vectors = np.linalg.eigh(laplacian.toarray())[1]
    else:
        start = np.random.default_rng(0).standard_normal(len(degree))
        values, vectors = eigsh(laplacian.tocsc(), k=count, sigma=-1e-3, which="LM", v0=start)
        vectors = vectors[:, np.argsort(values)]
    first: Float64[Array, "n k"] = vectors[:, :count]
    return first


def _k_means(rows: Float64[Array, "n k"], count: int, seed: int) -> Int[Array, " n"]:
    """Labels of the best of several runs."""
    cv2.setRNGSeed(seed)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-6)
    start = np.zeros((len(rows), 1), np.int32)
    _, labels, _ = cv2.kmeans(
        rows.astype(np.float32), count, start, criteria, ATTEMPTS, cv2.KMEANS_PP_CENTERS
    )
    return labels.ravel().astype(np.int64)
