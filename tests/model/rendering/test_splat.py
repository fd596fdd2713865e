"""The tiled renderer against the formula written out densely, in float64."""

import math

import numpy as np
import pytest
import torch

from model.rendering.splat import SplatRenderer
from model.types import Camera


def camera_at(width=37, height=29, focal=40.0, skew=0.0):
    angle = 0.3
    pose = np.eye(4)
    pose[:3, :3] = [
        [math.cos(angle), 0, math.sin(angle)],
        [0, 1, 0],
        [-math.sin(angle), 0, math.cos(angle)],
    ]
    pose[:3, 3] = [0.1, -0.2, -1.5]
    intrinsics = np.array([[focal, skew, width / 2], [0, focal * 1.1, height / 2], [0, 0, 1]])
    return Camera(intrinsics=intrinsics, world_from_camera=pose, width=width, height=height)


def random_gaussians(count, seed=0, dtype=torch.float64):
    rng = np.random.default_rng(seed)
    arrays = (
        rng.uniform(-0.35, 0.35, (count, 3)) + np.array([0.45, -0.2, 0.0]),
        rng.uniform(0.01, 0.08, (count, 3)),
        rng.normal(size=(count, 4)),
        rng.uniform(0.2, 0.95, count),
        rng.uniform(0, 1, (count, 3)),
    )
    return tuple(torch.tensor(array, dtype=dtype) for array in arrays)


def dense_image(means, scales, quaternions, opacities, colors, camera):
    """Colour, alpha and depth by the textbook, one Gaussian after another over the whole image."""
    intrinsics = torch.tensor(camera.intrinsics)
    view = torch.linalg.inv(torch.tensor(camera.world_from_camera))
    y, x = torch.meshgrid(
        torch.arange(camera.height, dtype=torch.float64),
        torch.arange(camera.width, dtype=torch.float64),
        indexing="ij",
    )
    pixels = torch.stack([x, y], dim=-1)
    local = means @ view[:3, :3].T + view[:3, 3]
    color = torch.zeros(camera.height, camera.width, 3, dtype=torch.float64)
    depth = torch.zeros(camera.height, camera.width, dtype=torch.float64)
    through = torch.ones(camera.height, camera.width, dtype=torch.float64)
    for i in torch.argsort(local[:, 2]).tolist():
        if local[i, 2] <= 0.01:
            continue
        px, py, pz = local[i]
        fx, fy, skew = intrinsics[0, 0], intrinsics[1, 1], intrinsics[0, 1]
        zero = torch.zeros_like(pz)
        jacobian = torch.stack(
            [
                torch.stack([fx / pz, skew / pz, -(fx * px + skew * py) / pz**2]),
                torch.stack([zero, fy / pz, -fy * py / pz**2]),
            ]
        )
        center = torch.stack([(fx * px + skew * py) / pz + intrinsics[0, 2], fy * py / pz + intrinsics[1, 2]])
        w, *v = quaternions[i] / quaternions[i].norm()
        v = torch.stack(v)
        cross = torch.stack(
            [
                torch.stack([zero, -v[2], v[1]]),
                torch.stack([v[2], zero, -v[0]]),
                torch.stack([-v[1], v[0], zero]),
            ]
        )
        rotation = torch.eye(3, dtype=torch.float64) + 2 * w * cross + 2 * cross @ cross  # Rodrigues
        sigma = rotation @ torch.diag(scales[i] ** 2) @ rotation.T
        flat = jacobian @ view[:3, :3] @ sigma @ view[:3, :3].T @ jacobian.T + 0.3 * torch.eye(
            2, dtype=torch.float64
        )
        d = pixels - center
        alpha = opacities[i] * torch.exp(-0.5 * torch.einsum("hwi,ij,hwj->hw", d, torch.linalg.inv(flat), d))
        alpha = torch.where(alpha < 1 / 255, torch.zeros_like(alpha), alpha.clamp_max(0.999))
        color = color + (through * alpha)[..., None] * colors[i]
        depth = depth + through * alpha * pz
        through = through * (1 - alpha)
    alpha = 1 - through
    return color, alpha, torch.where(alpha > 0, depth / alpha.clamp_min(1e-12), torch.zeros_like(depth))


@pytest.mark.parametrize("skew", [0.0, 3.0])
def test_values_match_the_dense_formula(skew):
    arguments, camera = random_gaussians(60), camera_at(skew=skew)
    found = SplatRenderer(transmittance_floor=0.0)(*arguments, camera)
    color, alpha, depth = dense_image(*arguments, camera)
    assert alpha.max() > 0.9
    torch.testing.assert_close(found.color, color, atol=1e-12, rtol=1e-12)
    torch.testing.assert_close(found.alpha, alpha, atol=1e-12, rtol=1e-12)
    torch.testing.assert_close(found.depth, depth, atol=1e-9, rtol=1e-9)


def test_gradients_match_the_dense_formula():
    camera, arguments = camera_at(), random_gaussians(40)
    weights = torch.tensor(np.random.default_rng(1).normal(size=(camera.height, camera.width, 5)))

    def gradients(render):
        leaves = [argument.clone().requires_grad_() for argument in arguments]
        color, alpha, depth = render(*leaves)
        stacked = torch.cat([color, alpha[..., None], depth[..., None]], dim=-1)
        return torch.autograd.grad((weights * stacked).sum(), leaves)

    def tiled(*leaves):
        image = SplatRenderer(transmittance_floor=0.0)(*leaves, camera)
        return image.color, image.alpha, image.depth

    for found, expected in zip(
        gradients(tiled), gradients(lambda *leaves: dense_image(*leaves, camera)), strict=True
    ):
        assert expected.abs().max() > 0
        torch.testing.assert_close(found, expected, atol=1e-8, rtol=1e-8)


def test_gradcheck():
    camera = camera_at(width=11, height=9, focal=12.0)
    arguments = [argument.clone().requires_grad_() for argument in random_gaussians(4, seed=3)]

    def render(*leaves):
        image = SplatRenderer(transmittance_floor=0.0)(*leaves, camera)
        return image.color, image.alpha

    assert torch.autograd.gradcheck(render, arguments, eps=1e-7, atol=1e-5)


def test_single_precision_and_early_termination_change_little():
    camera = camera_at(width=64, height=48, focal=70.0)
    arguments = random_gaussians(800, seed=2)
    color, alpha, _ = dense_image(*arguments, camera)
    with torch.no_grad():
        found = SplatRenderer()(*(argument.float() for argument in arguments), camera)
    assert found.color.dtype == torch.float32
    torch.testing.assert_close(found.color.double(), color, atol=2e-3, rtol=0)
    torch.testing.assert_close(found.alpha.double(), alpha, atol=2e-3, rtol=0)


def test_what_is_behind_the_camera_is_not_seen():
    camera = camera_at()
    means, *rest = random_gaussians(20)
    behind = torch.tensor(camera.position - 1.0 * camera.forward) + 0.01 * means
    straddling = torch.tensor(camera.position) + 0.005 * (means - means.mean(0))
    for culled in (behind, straddling):
        image = SplatRenderer()(culled, *rest, camera)
        assert image.alpha.max() == 0
        assert image.color.abs().max() == 0
        assert image.depth.abs().max() == 0
        both = SplatRenderer()(
            torch.cat([means, culled]), *(torch.cat([tensor, tensor]) for tensor in rest), camera
        )
        alone = SplatRenderer()(means, *rest, camera)
        torch.testing.assert_close(both.color, alone.color)


def test_nearer_gaussians_hide_farther_ones():
    camera = Camera(
        intrinsics=np.array([[30.0, 0, 10], [0, 30.0, 10], [0, 0, 1]]),
        world_from_camera=np.eye(4),
        width=21,
        height=21,
    )
    means = torch.tensor([[0, 0, 2.0], [0, 0, 1.0]])
    scales = torch.full((2, 3), 0.1)
    quaternions = torch.tensor([[1.0, 0, 0, 0]]).repeat(2, 1)
    colors = torch.tensor([[1.0, 0, 0], [0, 1.0, 0]])
    image = SplatRenderer()(means, scales, quaternions, torch.tensor([0.9, 0.9]), colors, camera)
    center = image.color[10, 10]
    torch.testing.assert_close(center, torch.tensor([0.09, 0.9, 0.0]), atol=1e-4, rtol=0)
    assert abs(image.depth[10, 10] - (0.9 * 1 + 0.09 * 2) / 0.99) < 1e-3


def test_no_gaussians_at_all():
    camera = camera_at()
    image = SplatRenderer()(*random_gaussians(0, dtype=torch.float32), camera)
    assert image.alpha.shape == (29, 37)
    assert image.alpha.max() == 0
