import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from model.rotations import matrices
from model.skinning import Skin, bind
from model.types import Gaussians, Topology


def cloud(shape, rng):
    if shape == "rope":
        return np.stack([np.linspace(0, 0.5, 40), np.zeros(40), np.zeros(40)], axis=1)
    size = {"sheet": [0.3, 0.3, 0.0], "solid": [0.3, 0.2, 0.1]}[shape]
    return rng.uniform(0, 1, (300, 3)) * size


def body(shape="solid", gaussian_count=500, seed=0):
    """Random Gaussians in and around a body of points."""
    rng = np.random.default_rng(seed)
    points = cloud(shape, rng).astype(np.float32)
    pairs = cKDTree(points).query(points, k=7)[1]
    springs = np.unique(
        np.sort(np.stack([np.repeat(pairs[:, 0], 6), pairs[:, 1:].ravel()], 1), axis=1), axis=0
    ).astype(np.int32)
    means = points[rng.integers(len(points), size=gaussian_count)] + rng.normal(0, 0.005, (gaussian_count, 3))
    means = means.astype(np.float32)
    index, weight = bind(means, points, springs=springs)
    gaussians = Gaussians(
        means=means,
        scales=np.full((gaussian_count, 3), 0.01, np.float32),
        quaternions=Rotation.random(gaussian_count, rng=rng).as_quat(scalar_first=True).astype(np.float32),
        opacities=np.full(gaussian_count, 0.9, np.float32),
        colors=np.full((gaussian_count, 3), 0.5, np.float32),
        volumes=np.full(gaussian_count, 1e-6, np.float32),
    )
    topology = Topology(
        points=points,
        mass=np.ones(len(points), np.float32),
        springs=springs,
        rest_length=np.linalg.norm(points[springs[:, 0]] - points[springs[:, 1]], axis=1),
        part=np.zeros(len(points), np.int32),
        binding_index=index,
        binding_weight=weight,
        controller_points=np.zeros((0, 3), np.float32),
        controller_springs=np.zeros((0, 2), np.int32),
        controller_rest_length=np.zeros(0, np.float32),
    )
    return gaussians, topology


@pytest.mark.parametrize("shape", ["rope", "sheet", "solid"])
def test_rest_is_left_as_it_is(shape):
    gaussians, topology = body(shape)
    means, quaternions = Skin(gaussians, topology)(torch.tensor(topology.points))
    np.testing.assert_allclose(means, gaussians.means, atol=1e-6)
    alignment = (quaternions * torch.tensor(gaussians.quaternions)).sum(dim=1).abs()
    np.testing.assert_allclose(alignment, 1.0, atol=1e-6)


@pytest.mark.parametrize("shape", ["rope", "sheet", "solid"])
@pytest.mark.parametrize("turn", [[0.3, -0.2, 0.5], [0.0, 0.0, np.pi], [2.0, 1.5, -1.0]])
def test_rigid_motion_is_reproduced_exactly(shape, turn):
    gaussians, topology = body(shape)
    rotation, shift = Rotation.from_rotvec(turn), np.array([0.4, -0.3, 0.2])
    moved = torch.tensor(rotation.apply(topology.points) + shift, dtype=torch.float32)
    means, quaternions = Skin(gaussians, topology)(moved)
    found = matrices(quaternions).numpy()
    before = matrices(torch.tensor(gaussians.quaternions)).numpy()
    if shape == "rope":  # points on a line do not show how they turn about it: only the line is certain
        expected = rotation.apply(gaussians.means * [1, 0, 0]) + shift
        axis = rotation.apply([1, 0, 0])
        along, across = (means.numpy() - expected) @ axis, gaussians.means[:, 1:]
        np.testing.assert_allclose(along, 0, atol=2e-6)
        np.testing.assert_allclose(
            np.linalg.norm(means.numpy() - expected, axis=1), np.linalg.norm(across, axis=1), atol=2e-6
        )
        return
    np.testing.assert_allclose(means, rotation.apply(gaussians.means) + shift, atol=2e-6)
    np.testing.assert_allclose(found, rotation.as_matrix() @ before, atol=1e-5)


def test_a_bent_sheet_turns_its_gaussians_along():
    gaussians, topology = body("sheet", gaussian_count=2000)
    radius = 0.15

    def bend(points):
        angle = points[:, 0] / radius
        inner = radius - points[:, 2]
        return np.stack([inner * np.sin(angle), points[:, 1], radius - inner * np.cos(angle)], axis=1)

    moved = torch.tensor(bend(topology.points), dtype=torch.float32)
    means, quaternions = Skin(gaussians, topology)(moved)
    within = (gaussians.means[:, 0] > 0.03) & (gaussians.means[:, 0] < 0.27)
    error = np.linalg.norm(means.numpy() - bend(gaussians.means), axis=1)[within]
    assert error.mean() < 1e-3
    expected = Rotation.from_rotvec(np.outer(-gaussians.means[:, 0] / radius, [0, 1, 0])).as_matrix()
    found = matrices(quaternions) @ matrices(torch.tensor(gaussians.quaternions)).transpose(1, 2)
    cosine = np.einsum("nij,nij->n", found.numpy(), expected) / 2 - 0.5
    assert np.degrees(np.arccos(cosine[within].clip(-1, 1))).mean() < 5


def test_gradients_reach_the_points():
    gaussians, topology = body(gaussian_count=30)
    skin = Skin(gaussians, topology).double()
    noise = np.random.default_rng(1).normal(0, 0.002, topology.points.shape)
    points = torch.tensor(topology.points + noise, dtype=torch.float64)
    direction = torch.tensor(np.random.default_rng(2).normal(size=points.shape))
    weights = torch.tensor(np.random.default_rng(3).normal(size=(30, 7)))

    def value(step):
        return (weights * torch.cat(skin(points + step * direction), dim=1)).sum()

    step = torch.zeros((), dtype=torch.float64, requires_grad=True)
    (gradient,) = torch.autograd.grad(value(step), step)
    with torch.no_grad():
        numeric = (value(torch.tensor(1e-6)) - value(torch.tensor(-1e-6))) / 2e-6
    assert abs(numeric) > 1e-2
    torch.testing.assert_close(gradient, numeric, rtol=1e-5, atol=1e-6)


def test_weights_sum_to_one_and_the_nearest_counts_most():
    gaussians, topology = body()
    index, weight = bind(gaussians.means, topology.points, k=5)
    assert index.shape == weight.shape == (500, 5)
    np.testing.assert_allclose(weight.sum(axis=1), 1.0, atol=1e-6)
    np.testing.assert_array_equal(index[:, 0], cKDTree(topology.points).query(gaussians.means)[1])
    assert (np.diff(weight, axis=1) <= 0).all()


def test_nothing_is_bound_across_a_gap():
    line = np.linspace(0, 1, 101)
    left = np.stack([line, np.zeros(101), np.zeros(101)], axis=1)
    points = np.concatenate([left, left + np.array([0, 0.015, 0])]).astype(
        np.float32
    )  # two strands, not connected
    springs = np.array([(i, i + 1) for i in range(201) if i != 100])
    means = (left + np.array([0, 0.005, 0])).astype(np.float32)
    index, weight = bind(means, points, k=8, springs=springs)
    assert index[weight > 0].max() <= 100
    np.testing.assert_allclose(weight.sum(axis=1), 1.0, atol=1e-6)
    free, free_weight = bind(means, points, k=8)
    assert free[free_weight > 0].max() > 100


def test_fewer_points_than_asked_for():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    index, weight = bind(np.zeros((4, 3), np.float32), points, k=8)
    assert index.shape == (4, 3)
    np.testing.assert_allclose(weight.sum(axis=1), 1.0, atol=1e-6)
