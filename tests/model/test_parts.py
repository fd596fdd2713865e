"""Partitions: connected, large enough, stable."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from model.errors import InputError
from model.neighbourhood import neighbourhood_graph
from model.parts import segment_parts
from model.types import Features, Gaussians

SPACING = 0.01
CAPSULES = {
    "body": ((0, 0, 0), (0, 0.09, 0), 0.05),
    "head": ((0, 0.185, 0), (0, 0.19, 0), 0.045),
    "arm": ((0.04, 0.1, 0), (0.15, 0.14, 0), 0.022),
    "other arm": ((-0.04, 0.1, 0), (-0.15, 0.14, 0), 0.022),
    "leg": ((0.03, -0.03, 0), (0.09, -0.14, 0), 0.024),
    "other leg": ((-0.03, -0.03, 0), (-0.09, -0.14, 0), 0.024),
}


def gaussians(points):
    count = len(points)
    return Gaussians(
        means=np.asarray(points, np.float32),
        scales=np.full((count, 3), 0.5 * SPACING, np.float32),
        quaternions=np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
        opacities=np.full(count, 0.9, np.float32),
        colors=np.full((count, 3), 0.5, np.float32),
        volumes=np.full(count, SPACING**3, np.float32),
    )


def features(values):
    return Features(np.asarray(values, np.float32), np.zeros(len(values), int))


def jittered_grid(low, high, seed=0, spacing=SPACING):
    axes = [np.arange(a, b, spacing) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return points + np.random.default_rng(seed).uniform(-0.25, 0.25, points.shape) * spacing


def plush(seed=0):
    """Body, head and four limbs, all of one colour; which of them each point belongs to."""
    points = jittered_grid((-0.2, -0.2, -0.06), (0.2, 0.25, 0.06), seed)
    distances = []
    for start, end, radius in CAPSULES.values():
        a, b = np.array(start), np.array(end)
        along = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        distances.append(np.linalg.norm(points - a - along[:, None] * (b - a), axis=1) - radius)
    inside = np.min(distances, axis=0) < 0
    return points[inside], np.argmin(distances, axis=0)[inside]


def noise(count, seed=0, dim=6):
    return np.random.default_rng(seed).normal(0, 0.1, (count, dim))


def rand_index(first, second):
    """Adjusted Rand index (Hubert & Arabie 1985), independent of the code under test."""
    table = np.zeros((first.max() + 1, second.max() + 1))
    np.add.at(table, (first, second), 1)
    pairs = lambda n: (n * (n - 1) / 2).sum()  # noqa: E731
    rows, columns, total = pairs(table.sum(1)), pairs(table.sum(0)), pairs(np.array([len(first)]))
    expected = rows * columns / total
    return (pairs(table) - expected) / ((rows + columns) / 2 - expected)


def assert_connected(points, parts):
    graph = neighbourhood_graph(points)
    for part in range(parts.count):
        nodes = np.flatnonzero(parts.labels == part)
        assert connected_components(graph[nodes][:, nodes], directed=False)[0] == 1


def assert_touching(points, parts):
    """By distance alone: within a part every point can be reached in steps of less than two spacings."""
    for part in range(parts.count):
        own = points[parts.labels == part]
        near = cKDTree(own).sparse_distance_matrix(cKDTree(own), 2.2 * SPACING)
        assert connected_components(near, directed=False)[0] == 1


def test_a_plush_falls_into_body_head_and_limbs():
    points, truth = plush()
    parts = segment_parts(gaussians(points), features(noise(len(points))), count=6)
    assert parts.count == 6
    assert rand_index(parts.labels.astype(int), truth) > 0.8
    assert_touching(points, parts)


def test_five_parts_are_found_where_six_would_fit():
    points, _ = plush()
    parts = segment_parts(gaussians(points), features(noise(len(points))))
    assert parts.count == 5
    assert parts.warnings == ()
    assert np.array_equal(np.unique(parts.labels), np.arange(5))
    assert_touching(points, parts)


def test_a_change_of_features_is_a_border():
    """A plain bar, two thirds of it of another stuff."""
    points = jittered_grid((0, 0, 0), (0.3, 0.06, 0.06))
    stuff = (points[:, 0] > 0.1).astype(int)
    values = noise(len(points)) + 3.0 * stuff[:, None]
    parts = segment_parts(gaussians(points), features(values), count=2)
    assert rand_index(parts.labels.astype(int), stuff) > 0.9
    plain = segment_parts(gaussians(points), features(noise(len(points))), count=2)
    assert rand_index(plain.labels.astype(int), stuff) < 0.6


def test_units_of_the_features_do_not_matter():
    points, _ = plush()
    values = noise(len(points)) + (points[:, 1:2] > 0.1)
    one, other = (segment_parts(gaussians(points), features(scale * values)) for scale in (1.0, 1000.0))
    assert rand_index(one.labels.astype(int), other.labels.astype(int)) > 0.99


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8])
def test_sheets_ropes_and_bodies_give_as_many_parts_as_asked(count):
    sheet = jittered_grid((0, 0, 0), (0.4, 0.4, 0.011))
    rope = jittered_grid((0, 0, 0), (0.6, 0.03, 0.03))
    for points in (sheet, rope, plush()[0]):
        parts = segment_parts(gaussians(points), features(noise(len(points))), count=count)
        assert parts.count == count
        assert np.bincount(parts.labels).min() >= 0.03 * len(points)
        assert_connected(points, parts)


def test_seeds_agree():
    points, _ = plush()
    values = features(noise(len(points)))
    runs = [segment_parts(gaussians(points), values, seed=seed).labels.astype(int) for seed in range(4)]
    assert min(rand_index(runs[0], other) for other in runs[1:]) >= 0.8


def test_noise_moves_little():
    """With as many parts as the body has: which limb joins it if one must is a toss-up."""
    points, _ = plush()
    base = noise(len(points)) + (points[:, 1:2] > 0.13)
    first = segment_parts(gaussians(points), features(base), count=6).labels.astype(int)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        moved = points + rng.normal(0, 0.05 * SPACING, points.shape)
        noisy = features(base + rng.normal(0, 0.05, base.shape))
        again = segment_parts(gaussians(moved), noisy, count=6)
        assert rand_index(first, again.labels.astype(int)) >= 0.8


def test_same_input_same_bytes():
    points, _ = plush()
    runs = [segment_parts(gaussians(points), features(noise(len(points))), seed=3) for _ in range(2)]
    assert runs[0].labels.tobytes() == runs[1].labels.tobytes()


def test_large_bodies_are_coarsened_with_the_same_result():
    fine = jittered_grid((0, 0, 0), (0.3, 0.06, 0.06), spacing=0.006)
    assert len(fine) > 4000
    stuff = (fine[:, 0] > 0.1).astype(int)
    parts = segment_parts(gaussians(fine), features(noise(len(fine)) + 3.0 * stuff[:, None]), count=2)
    assert rand_index(parts.labels.astype(int), stuff) > 0.9
    assert_connected(fine, parts)


def test_labels_are_ordered_by_size():
    points, _ = plush()
    sizes = np.bincount(segment_parts(gaussians(points), features(noise(len(points)))).labels)
    assert (np.diff(sizes) <= 0).all()


@settings(max_examples=25, derandomize=True)
@given(
    count=st.integers(1, 7),
    seed=st.integers(0, 1000),
    size=st.integers(1, 200),
    min_share=st.sampled_from([0.0, 0.03, 0.2]),
)
def test_any_cloud_becomes_a_valid_partition(count, seed, size, min_share):
    rng = np.random.default_rng(seed)
    points = rng.normal(0, 1, (size, 3)) + rng.integers(0, 3, (size, 1)) * 4.0
    parts = segment_parts(gaussians(points), features(noise(size, seed)), count, seed, min_share)
    assert 1 <= parts.count <= count
    sizes = np.bincount(parts.labels, minlength=parts.count)
    assert len(sizes) == parts.count
    assert sizes.min() >= min(size, max(1, min_share * size))
    assert (parts.count < count) == bool(parts.warnings)
    assert_connected(points.astype(np.float32), parts)


def test_too_small_an_object_gets_fewer_parts_and_a_warning():
    points = jittered_grid((0, 0, 0), (0.1, 0.1, 0.1))
    parts = segment_parts(gaussians(points), features(noise(len(points))), count=5, min_share=0.3)
    assert 1 <= parts.count <= 3
    assert parts.warnings == (f"5 parts were asked for, the object supports {parts.count}",)


@pytest.mark.parametrize(
    ("options", "message"),
    [({"count": 0}, "at least 1"), ({"min_share": 1.0}, "least share"), ({"min_share": -0.1}, "least share")],
)
def test_senseless_options_are_refused(options, message):
    points = jittered_grid((0, 0, 0), (0.05, 0.05, 0.05))
    with pytest.raises(InputError, match=message):
        segment_parts(gaussians(points), features(noise(len(points))), **options)


def test_features_of_another_object_are_refused():
    points = jittered_grid((0, 0, 0), (0.05, 0.05, 0.05))
    with pytest.raises(InputError, match="7 features for 125 Gaussians"):
        segment_parts(gaussians(points), features(noise(7)))
