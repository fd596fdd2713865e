import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from model.errors import InputError
from model.skinning import bind
from model.topology import build_topology
from model.types import Controllers, Estimate, Gaussians, MaterialPrior, Parts

SPACING = 0.01


def gaussians_at(means, volume=SPACING**3):
    count = len(means)
    identity = np.tile(np.float32([1, 0, 0, 0]), (count, 1))
    return Gaussians(
        means=np.asarray(means, np.float32),
        scales=np.full((count, 3), SPACING / 2, np.float32),
        quaternions=identity,
        opacities=np.full(count, 0.9, np.float32),
        colors=np.full((count, 3), 0.5, np.float32),
        volumes=np.full(count, volume, np.float32),
    )


def grid(x, y, z, spacing=SPACING):
    axes = [np.arange(n) * spacing for n in (x, y, z)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def jittered(points, amount=0.2 * SPACING):
    return points + np.random.default_rng(0).uniform(-amount, amount, points.shape)


def material(stiffness=5e4, density=150.0):
    values = {
        "stiffness": stiffness,
        "density": density,
        "damping": 0.1,
        "drag_rate": 0.5,
        "friction": 0.5,
        "restitution": 0.1,
    }
    properties = {name: Estimate(value, 0.5, "1") for name, value in values.items()}
    return MaterialPrior(np.full(10, 0.1), properties, "solid")


def controllers_at(points):
    points = np.asarray(points, np.float32).reshape(-1, 3)
    return Controllers(np.repeat(points[None], 3, axis=0), np.zeros(len(points), int))


def build(means, labels=None, priors=None, shape="solid", grips=(), volume=SPACING**3, **options):
    labels = np.zeros(len(means), np.int32) if labels is None else labels
    priors = [material()] * (int(labels.max()) + 1) if priors is None else priors
    parts = Parts(labels.astype(np.int32), len(priors))
    held = controllers_at(grips)
    return build_topology(gaussians_at(means, volume), parts, priors, shape, held, bind=bind, **options)


def pieces(topology):
    springs, count = topology.springs, len(topology.points)
    graph = coo_matrix((np.ones(len(springs)), springs.T), shape=(count, count))
    return connected_components(graph, directed=False)[0]


def test_springs_are_sound():
    topology = build(jittered(grid(12, 8, 6)), point_count=200)
    assert len(topology.points) == 200
    first, second = topology.springs.T
    assert topology.springs.dtype == np.int32
    assert (first < second).all()
    assert len(np.unique(topology.springs, axis=0)) == len(topology.springs)
    length = np.linalg.norm(topology.points[first] - topology.points[second], axis=1)
    np.testing.assert_allclose(topology.rest_length, length, rtol=1e-6)
    assert length.min() > 0
    assert pieces(topology) == 1
    assert topology.binding_index.shape == (len(grid(12, 8, 6)), 8)
    np.testing.assert_allclose(topology.binding_weight.sum(axis=1), 1, atol=1e-5)


def test_points_cover_the_volume_evenly_whatever_the_density_of_gaussians():
    dense = grid(21, 11, 11, SPACING / 2)
    means = np.concatenate([grid(20, 6, 6) + np.array([0.11, 0, 0]), dense])
    topology = build(jittered(means), point_count=150)
    share = (topology.points[:, 0] < 0.105).mean()
    assert 0.25 < share < 0.42


def test_mass_is_density_times_volume_and_no_point_is_weightless():
    means = jittered(grid(12, 8, 6))
    labels = (means[:, 0] > 0.05).astype(np.int32)
    priors = [material(density=100.0), material(density=400.0)]
    topology = build(means, labels, priors, point_count=150)
    expected = (np.array([100.0, 400.0])[labels] * SPACING**3).sum()
    np.testing.assert_allclose(topology.mass.sum(), expected, rtol=1e-5)
    assert topology.mass.min() > 0.3 * np.median(topology.mass)
    heavy = topology.mass[topology.part == 1].mean() / topology.mass[topology.part == 0].mean()
    assert heavy > 2


def test_softer_and_denser_parts_get_more_springs():
    means = jittered(grid(24, 6, 6))
    labels = (means[:, 0] > 0.12).astype(np.int32)
    soft_left = build(means, labels, [material(5e3), material(5e5)], point_count=400)
    dense_left = build(means, labels, [material(density=600.0), material(density=40.0)], point_count=400)
    for topology in (soft_left, dense_left):
        degree = np.bincount(topology.springs.ravel(), minlength=len(topology.points))
        left, right = (degree[topology.part == part].mean() for part in (0, 1))
        assert left > 1.15 * right


def test_few_springs_cross_a_border():
    means = jittered(grid(24, 6, 6))
    labels = (means[:, 0] > 0.12).astype(np.int32)

    def crossing(topology):
        side = topology.points[topology.springs][..., 0] > 0.12
        return (side[:, 0] != side[:, 1]).sum()

    one, two = build(means, point_count=400), build(means, labels, point_count=400)
    assert 0 < crossing(two) < 0.75 * crossing(one)
    assert pieces(two) == 1


def test_near_limbs_are_not_joined():
    gap = 2.5 * SPACING
    lower, upper = grid(20, 3, 3), grid(20, 3, 3) + np.array([0, 0, 2 * SPACING + gap])
    bend = grid(3, 3, 8) + np.array([-3 * SPACING, 0, 0])
    means = np.concatenate([lower, upper, bend])
    topology = build(means, point_count=150)
    far = (topology.points[:, 0] > 0.06).nonzero()[0]
    middle = 2 * SPACING + gap / 2
    ends = topology.points[topology.springs]
    out_there = np.isin(topology.springs, far).all(axis=1)
    across = (ends[:, 0, 2] - middle) * (ends[:, 1, 2] - middle) < 0
    spacing = np.median(topology.rest_length)
    assert spacing > 0.7 * gap, "the test needs limbs nearer than springs are long"
    assert not (out_there & across).any()
    assert pieces(topology) == 1
    assert topology.warnings == ()


def test_loose_pieces_are_bridged_with_a_warning():
    topology = build(np.concatenate([grid(6, 6, 6), grid(4, 4, 4) + np.array([0.3, 0, 0])]), point_count=150)
    assert pieces(topology) == 1
    assert "1 loose piece" in topology.warnings[0]


def test_a_sheet_is_one_layer_in_its_middle():
    x, y = np.meshgrid(np.arange(30), np.arange(30))
    face = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1) * SPACING
    means = jittered(np.concatenate([face, face + np.array([0, 0, 0.004])]), 0.0005)
    topology = build(means, shape="sheet", point_count=300)
    assert np.abs(topology.points[:, 2] - 0.002).max() < 0.0006
    flat = topology.points[:, :2]
    gaps = np.sort(np.linalg.norm(flat[:, None] - flat[None], axis=2), axis=1)[:, 1]
    assert gaps.min() > 0.3 * np.median(gaps)


def test_a_rope_has_several_points_per_section():
    angle = np.arange(0, 2 * np.pi, 2 * np.pi / 8)
    ring = np.concatenate([[[0, 0, 0]], np.stack([0 * angle, np.cos(angle), np.sin(angle)], 1) * 0.008])
    means = np.concatenate([ring + np.array([x, 0, 0]) for x in np.arange(0, 0.4, 0.004)])
    topology = build(jittered(means, 0.0005), shape="rope", volume=2e-4 * 0.4 / len(means), point_count=5000)
    per_section = len(topology.points) * 0.016 / 0.4
    assert 8 < per_section < 40
    offsets = topology.points[:, 1:]
    assert (np.ptp(offsets, axis=0) > 0.01).all()


def test_controllers_hold_firmly_and_never_by_a_spring_without_length():
    means = grid(8, 6, 6)
    grips = [means[0], means[-1] + 0.004, [0.02, 0.02, 0.02]]
    topology = build(means, grips=grips, point_count=10_000)
    count = np.bincount(topology.controller_springs[:, 0], minlength=3)
    assert (count >= 4).all()
    assert topology.controller_rest_length.min() > 0.2 * SPACING
    assert topology.controller_rest_length.max() < 3 * SPACING
    owner, point = topology.controller_springs.T
    length = np.linalg.norm(np.float32(grips)[owner] - topology.points[point], axis=1)
    np.testing.assert_allclose(topology.controller_rest_length, length, atol=1e-6)
    np.testing.assert_allclose(topology.controller_points, np.float32(grips))
    assert build(means, point_count=100).controller_springs.shape == (0, 2)


def test_a_controller_out_of_reach_holds_nothing():
    means = grid(8, 6, 6)
    far = build(means, grips=[[0.5, 0.5, 0.5], means[0]], point_count=100)
    assert set(far.controller_springs[:, 0]) == {1}
    assert len(far.controller_points) == 2
    assert "1 controller point(s) start more than" in far.warnings[0]
    alone = build(means, grips=[[0.5, 0.5, 0.5]], point_count=100)
    assert alone.controller_springs.shape == (0, 2)


def test_same_seed_same_topology():
    means = jittered(grid(10, 6, 6))
    first, second, other = (build(means, point_count=100, seed=seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first.points, second.points)
    np.testing.assert_array_equal(first.springs, second.springs)
    assert not np.array_equal(first.points, other.points)


def test_what_has_no_extent_or_too_few_priors_is_refused():
    with pytest.raises(InputError, match="no extent"):
        build(np.zeros((5, 3)))
    means = grid(4, 4, 4)
    parts = Parts((np.arange(len(means)) % 2).astype(np.int32), 2)
    with pytest.raises(InputError, match="2 parts but 1 material"):
        build_topology(gaussians_at(means), parts, [material()], "solid", controllers_at([]), bind=bind)
