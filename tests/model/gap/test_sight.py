"""Which places of an object are seen."""

import numpy as np
import torch

from model.gap.bodies.aside import Aside, Skin
from model.gap.bodies.body import between
from model.gap.sight import Sight


def test_a_place_is_a_weighted_mean_of_points():
    sight = Sight(torch.tensor([[0, 1], [1, 1]]), torch.tensor([[0.25, 0.75], [0.5, 0.5]]))
    points = torch.tensor([[0.0, 0.0, 0.0], [4.0, 0.0, 8.0]])
    torch.testing.assert_close(sight(points), torch.tensor([[3.0, 0.0, 6.0], [4.0, 0.0, 8.0]]))
    torch.testing.assert_close(sight.spread(torch.tensor([1.0, 3.0])), torch.tensor([2.5, 3.0]))


def test_a_skin_turns_as_in_numpy_in_many_worlds_at_once():
    rng = np.random.default_rng(0)
    line = np.cumsum(rng.normal([0.02, 0, 0], 0.004, (30, 3)), axis=0)
    seen = line[rng.integers(3, 27, 50)] + rng.normal(0, 0.008, (50, 3))
    index, weight = between(seen, line)
    aside = Aside.of(seen, line, index, weight)
    sight = Sight(torch.from_numpy(index), torch.from_numpy(weight), Skin.of(aside, torch.float64))
    np.testing.assert_allclose(sight(torch.from_numpy(line)).numpy(), seen, atol=1e-12)
    poses = np.cumsum(rng.normal([0.015, 0, 0], 0.01, (2, 3, 30, 3)), axis=-2)
    found = sight(torch.from_numpy(poses)).numpy()
    assert found.shape == (2, 3, 50, 3)
    for world in np.ndindex(2, 3):
        expected = (weight[..., None] * poses[world][index]).sum(1) + aside.turned(poses[world])
        np.testing.assert_allclose(found[world], expected, atol=1e-12)


def test_a_skin_has_slopes():
    rng = np.random.default_rng(1)
    line = np.stack([np.linspace(0, 0.2, 9), np.zeros(9), np.zeros(9)], 1)
    seen = line[2:7] + rng.normal(0, 0.01, (5, 3))
    aside = Aside.of(seen, line, *between(seen, line))
    skin = Skin.of(aside, torch.float64)
    pose = torch.from_numpy(line + rng.normal(0, 0.01, line.shape)).requires_grad_()
    assert torch.autograd.gradcheck(skin, (pose,))
