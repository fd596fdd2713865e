"""Every renderer, on what they all have to do alike."""

import builtins

import numpy as np
import pytest
import torch

from model.errors import MissingDependencyError
from model.rendering import ALL_RENDERERS, best_renderer
from model.rendering.gsplat import GsplatRenderer
from model.types import Camera

gpu = pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a CUDA device")
METHODS = [
    pytest.param(method, marks=[pytest.mark.gpu, gpu] if method.name == "gsplat" else [])
    for method in ALL_RENDERERS
]
CAMERA = Camera(
    intrinsics=np.array([[100.0, 0, 40], [0, 100.0, 30], [0, 0, 1]]),
    world_from_camera=np.eye(4),
    width=81,
    height=61,
)


def one_gaussian(position):
    return (
        torch.tensor([position]),
        torch.full((1, 3), 0.05),
        torch.tensor([[1.0, 0, 0, 0]]),
        torch.tensor([0.8]),
        torch.tensor([[0.9, 0.5, 0.1]]),
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_gaussian_appears_where_the_camera_projects_it(method):
    position = [0.12, -0.06, 1.0]
    image = method()(*one_gaussian(position), CAMERA)
    (x, y), depth = CAMERA.project(np.array(position))
    rows, columns = torch.meshgrid(torch.arange(61.0), torch.arange(81.0), indexing="ij")
    total = image.alpha.sum()
    assert abs((columns * image.alpha).sum() / total - x) < 0.02
    assert abs((rows * image.alpha).sum() / total - y) < 0.02
    peak = image.alpha[round(y), round(x)]
    assert abs(peak - 0.8) < 1e-3
    assert abs(image.depth[round(y), round(x)] - float(depth)) < 1e-3
    torch.testing.assert_close(
        image.color[round(y), round(x)], peak * torch.tensor([0.9, 0.5, 0.1]), atol=1e-4, rtol=0
    )


@pytest.mark.parametrize("method", METHODS)
def test_gradients_reach_every_argument(method):
    leaves = [argument.requires_grad_() for argument in one_gaussian([0.05, 0.0, 1.0])]
    image = method()(*leaves, CAMERA)
    (image.color.pow(2).sum() + image.alpha[:30].sum()).backward()
    for leaf, name in zip(leaves, ("means", "scales", "quaternions", "opacities", "colors"), strict=True):
        assert leaf.grad is not None, name
        if name != "quaternions":  # a sphere has no direction
            assert leaf.grad.abs().max() > 0, name


def test_the_best_renderer_runs_here():
    assert float(best_renderer()(*one_gaussian([0.0, 0.0, 1.0]), CAMERA).alpha.max()) > 0.7


def test_gsplat_says_what_is_missing(monkeypatch):
    real_import = builtins.__import__

    def refuse(name, *arguments, **options):
        if name == "gsplat":
            raise ImportError(name)
        return real_import(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", refuse)
    with pytest.raises(MissingDependencyError, match="pip install gsplat"):
        GsplatRenderer()


def test_renderers_have_the_names_that_the_command_offers():
    assert [each.name for each in ALL_RENDERERS] == ["splat", "gsplat"]
