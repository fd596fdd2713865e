import numpy as np
import pytest
import torch

from model.errors import InputError, MissingDependencyError
from model.evaluation.lpips import SCALE, SHIFT, Lpips

SIZES = {0: (64, 3, 11), 3: (192, 64, 5), 6: (384, 192, 3), 8: (256, 384, 3), 10: (256, 256, 3)}


@pytest.fixture(scope="module")
def weights(tmp_path_factory):
    """Random weights in the two formats."""
    folder = tmp_path_factory.mktemp("lpips")
    generator = torch.Generator().manual_seed(0)
    trunk = {"classifier.6.bias": torch.zeros(1000)}
    for name, (outputs, inputs, size) in SIZES.items():
        scale = (2.0 / (inputs * size * size)) ** 0.5
        trunk[f"features.{name}.weight"] = scale * torch.randn(
            outputs, inputs, size, size, generator=generator
        )
        trunk[f"features.{name}.bias"] = torch.zeros(outputs)
    heads = {
        f"lin{k}.model.1.weight": torch.rand(1, size[0], 1, 1, generator=generator)
        for k, size in enumerate(SIZES.values())
    }
    torch.save(trunk, folder / "alexnet.pth")
    torch.save(heads, folder / "alex.pth")
    return folder, trunk, heads


@pytest.fixture
def pictures():
    rng = np.random.default_rng(0)
    return rng.uniform(0, 1, (2, 64, 72, 3)).astype(np.float32)


def test_equal_pictures_have_no_distance_and_it_grows(weights, pictures):
    lpips, (first, second) = Lpips(weights[0]), pictures
    assert lpips.between(first, first) == 0.0
    nearer = (0.8 * first + 0.2 * second).astype(np.float32)
    assert 0.0 < lpips.between(first, nearer) < lpips.between(first, second)
    assert lpips.between(first, second) == pytest.approx(lpips.between(second, first), rel=1e-5)


def test_it_is_what_the_paper_says(weights, pictures):
    folder, trunk, heads = weights

    def features(picture):
        value = torch.as_tensor(picture).permute(2, 0, 1)[None] * 2 - 1
        value = (value - torch.tensor(SHIFT).view(1, 3, 1, 1)) / torch.tensor(SCALE).view(1, 3, 1, 1)
        found = []
        for name, stride, padding in ((0, 4, 2), (3, 1, 2), (6, 1, 1), (8, 1, 1), (10, 1, 1)):
            if name in (3, 6):
                value = torch.nn.functional.max_pool2d(value, 3, 2)
            weight, bias = trunk[f"features.{name}.weight"], trunk[f"features.{name}.bias"]
            value = torch.nn.functional.conv2d(value, weight, bias, stride, padding).clamp_min(0)
            found.append(torch.nn.functional.normalize(value, dim=1))
        return found

    expected = sum(
        float((head.reshape(1, -1, 1, 1) * (one - other) ** 2).sum(1).mean())
        for head, one, other in zip(heads.values(), features(pictures[0]), features(pictures[1]), strict=True)
    )
    assert Lpips(folder).between(*pictures) == pytest.approx(expected, rel=1e-4)


def test_weights_that_are_absent_or_others(weights, tmp_path):
    with pytest.raises(MissingDependencyError, match=r"LPIPS needs .*alexnet\.pth"):
        Lpips(tmp_path)
    torch.save(weights[1], tmp_path / "alexnet.pth")
    torch.save({"other": torch.zeros(1)}, tmp_path / "alex.pth")
    with pytest.raises(InputError, match="expected weights of AlexNet and of LPIPS"):
        Lpips(tmp_path)
    (tmp_path / "alex.pth").write_bytes(b"no weights")
    with pytest.raises(InputError, match="not a file of weights"):
        Lpips(tmp_path)
    torch.save([1], tmp_path / "alex.pth")
    with pytest.raises(InputError, match="expected weights by name, found list"):
        Lpips(tmp_path)
