import numpy as np

from model.playground.look import Look, on_gaussians


def test_at_rest_everything_is_where_it_was(twin):
    centers, covariances = Look(twin)(twin.topology.points)
    np.testing.assert_allclose(centers, twin.gaussians.means, atol=1e-6)
    expected = np.einsum("gi,ij->gij", twin.gaussians.scales**2, np.eye(3))
    np.testing.assert_allclose(covariances, expected, atol=1e-9)


def test_a_turned_object_has_turned_gaussians(twin):
    from dataclasses import replace

    long = replace(
        twin, gaussians=replace(twin.gaussians, scales=np.tile(np.float32([0.02, 0.01, 0.01]), (27, 1)))
    )
    quarter = np.float32([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    middle = twin.topology.points.mean(axis=0)
    turned = ((twin.topology.points - middle) @ quarter.T + middle).astype(np.float32)
    centers, covariances = Look(long)(turned)
    np.testing.assert_allclose(centers, turned, atol=1e-5)
    np.testing.assert_allclose(covariances, np.tile(np.diag([1e-4, 4e-4, 1e-4]), (27, 1, 1)), atol=1e-6)


def test_values_of_points_reach_the_gaussians_by_their_weights(twin):
    values = np.arange(27, dtype=np.float32)[:, None]
    np.testing.assert_allclose(on_gaussians(twin, values), values)
