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
    assert (np.linalg.norm(means, axis=1) > 0.043).all()
    np.testing.assert_array_equal(worn.normals, worn.outward)  # plastic is smooth


def test_fur_stands_out_and_is_ragged(ball):
    labels = np.zeros(len(ball), np.int32)
    smooth = dress(ball, labels, (Plastic((0.5, 0.4, 0.3), 1),), 0.006, np.random.default_rng(0))
    hairy = dress(ball, labels, (Fur((0.5, 0.4, 0.3), 1),), 0.006, np.random.default_rng(0))
    assert len(hairy.gaussians) > 2.5 * len(smooth.gaussians)
    far = [np.linalg.norm(one.gaussians.means, axis=1).max() for one in (smooth, hairy)]
    assert far[1] > far[0] + 0.002
    assert hairy.gaussians.colors.std() > smooth.gaussians.colors.std() + 0.03
    tips = hairy.gaussians.scales.max(axis=1) / hairy.gaussians.scales.min(axis=1)
    assert np.isclose(tips[: len(smooth.gaussians)], 2.5, atol=0.01).all()
    np.testing.assert_allclose(np.linalg.norm(hairy.normals, axis=1), 1, atol=1e-5)
