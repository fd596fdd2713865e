import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from model.rotations import matrices, multiply, nearest_rotations


def random_quaternions(count, seed=0):
    quaternions = Rotation.random(count, rng=np.random.default_rng(seed)).as_quat(scalar_first=True)
    return torch.tensor(quaternions)


def test_matrices_and_products_agree_with_scipy():
    left, right = random_quaternions(20), random_quaternions(20, seed=1)
    expected = Rotation.from_quat(left.numpy(), scalar_first=True) * Rotation.from_quat(
        right.numpy(), scalar_first=True
    )
    torch.testing.assert_close(matrices(multiply(left, right)), torch.tensor(expected.as_matrix()))
    torch.testing.assert_close(matrices(3.0 * left), matrices(left))


@pytest.mark.parametrize("rank", [3, 2])
def test_nearest_rotation_is_the_polar_decomposition(rank):
    rng = np.random.default_rng(2)
    rest = rng.normal(size=(30, 10, 3))
    rest[..., rank:] = 0
    deformation = rng.normal(size=(30, 1, 3, 3)) * 0.3 + np.eye(3)
    moved = (deformation @ rest[..., None])[..., 0]
    moment = np.einsum("nki,nkj->nij", moved, rest)
    left, _, right = np.linalg.svd(moment)
    left[..., -1] *= np.linalg.det(left @ right)[:, None]
    found = matrices(nearest_rotations(torch.tensor(moment)))
    torch.testing.assert_close(found, torch.tensor(left @ right), atol=1e-9, rtol=0)


def test_half_turns_are_found():
    for axis in np.eye(3):
        turn = torch.tensor(Rotation.from_rotvec(np.pi * axis).as_matrix())[None]
        torch.testing.assert_close(matrices(nearest_rotations(turn)), turn, atol=1e-12, rtol=0)


def test_gradients_even_where_smaller_eigenvalues_are_equal():
    general = torch.eye(3, dtype=torch.float64) + 0.3 * torch.tensor(
        np.random.default_rng(4).normal(size=(5, 3, 3))
    )
    symmetric = torch.eye(3, dtype=torch.float64)[None]
    moment = torch.cat([general, symmetric]).requires_grad_()
    assert torch.autograd.gradcheck(nearest_rotations, moment, atol=1e-6)
