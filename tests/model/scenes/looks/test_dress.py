import numpy as np

from model.scenes.looks.dress import dress
from model.scenes.looks.fur import Fur
from model.scenes.looks.plastic import Plastic


def test_each_half_wears_its_own_look(ball):
    labels = (ball.means[:, 0] > 0).astype(np.int32)
    looks = (Plastic((0.8, 0.1, 0.1), 1), Plastic((0.1, 0.2, 0.8), 2))
    worn = dress(ball, labels, looks, 0.006, np.random.default_rng(0))
    means, colors = worn.gaussians.means, worn.gaussians.colors
    for half, dye in ((means[:, 0] < -0.01, (0.8, 0.1, 0.1)), (means[:, 0] > 0.01, (0.1, 0.2, 0.8))):
        assert half.sum() > 50
        assert np.abs(colors[half] - dye).max() < 1e-6
    outside = worn.outward.any(axis=1)
    assert (np.linalg.norm(means[outside], axis=1) > 0.043).all()
    np.testing.assert_array_equal(worn.normals, worn.outward)  # plastic is smooth
    np.testing.assert_array_equal(means[~outside], ball.means)  # what fills gaps


def test_fur_stands_out_and_is_ragged(ball):
    labels = np.zeros(len(ball), np.int32)
    smooth = dress(ball, labels, (Plastic((0.5, 0.4, 0.3), 1),), 0.006, np.random.default_rng(0))
    hairy = dress(ball, labels, (Fur((0.5, 0.4, 0.3), 1),), 0.006, np.random.default_rng(0))
    outside = smooth.outward.any(axis=1).sum()
    assert len(hairy.gaussians) - len(smooth.gaussians) == 2 * outside
    far = [np.linalg.norm(one.gaussians.means, axis=1).max() for one in (smooth, hairy)]
    assert far[1] > far[0] + 0.002
    assert hairy.gaussians.colors.std() > smooth.gaussians.colors.std() + 0.03
    thin = hairy.gaussians.scales.max(axis=1) / hairy.gaussians.scales.min(axis=1)
    assert np.isclose(thin[:outside], 2.5, atol=0.01).all()
    length = np.linalg.norm(hairy.normals, axis=1)
    np.testing.assert_allclose(length[hairy.outward.any(axis=1)], 1, atol=1e-5)
