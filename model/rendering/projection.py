"""3D Gaussians → 2D Gaussians: the local affine approximation of perspective."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from model.rotations import matrices
from model.types import Camera

NEAR = 1e-2
"""Gaussians closer than this along the optical axis [m] are culled."""
DILATION = 0.3
"""Variance added to every projected Gaussian [px²]: a low-pass filter of about one pixel."""
MARGIN = 0.3
"""Beyond the image by more than this share of its size, the Jacobian stops growing."""


@dataclass(frozen=True)
class Splats:
    """Gaussians as one camera sees them."""

    centers: Float[Tensor, "G 2"]
    """[px]."""
    covariances: Float[Tensor, "G 2 2"]
    """[px²], dilated."""
    depths: Float[Tensor, " G"]
    """Along the optical axis [m]."""


def camera_tensors(camera: Camera, like: Tensor) -> tuple[Float[Tensor, "3 3"], Float[Tensor, "4 4"]]:
    """Intrinsics and pose (world from camera) with the type and device of `like`."""
    intrinsics = torch.as_tensor(camera.intrinsics).to(like)
    pose = torch.as_tensor(camera.world_from_camera).to(like)
    return intrinsics, pose


def project(
    means: Float[Tensor, "G 3"],
    scales: Float[Tensor, "G 3"],
    quaternions: Float[Tensor, "G 4"],
    camera: Camera,
) -> Splats:
    r"""Project Gaussians that lie in front of the camera.

    $\Sigma' = J W \Sigma W^T J^T + 0.3\,I$ with J the Jacobian of the projection at the mean.
    J is evaluated within a margin around the image, as the approximation fails far outside.

    Reference:
        Zwicker et al. (2001), EWA splatting; Kerbl et al. (2023), 3D Gaussian splatting, eq. 5.
    """
    intrinsics, pose = camera_tensors(camera, means)
    local = (means - pose[:3, 3]) @ pose[:3, :3]
    depths = local[:, 2]
    slopes = local[:, :2] / depths[:, None]
    focal = intrinsics[:2, :2]
    centers = slopes @ focal.T + intrinsics[:2, 2]

    jacobian = torch.cat(
        [focal.expand(len(means), 2, 2), -(_clamp(slopes, camera) @ focal.T)[..., None]], dim=-1
    )
    root = (jacobian / depths[:, None, None]) @ pose[:3, :3].T @ matrices(quaternions) * scales[:, None]
    dilation = DILATION * torch.eye(2).to(means)
    return Splats(centers=centers, covariances=root @ root.transpose(1, 2) + dilation, depths=depths)


def _clamp(slopes: Float[Tensor, "G 2"], camera: Camera) -> Float[Tensor, "G 2"]:
    """x/z and y/z, held within the image and a margin around it."""
    size = slopes.new_tensor([camera.width, camera.height])
    intrinsics, _ = camera_tensors(camera, slopes)
    focal, center = intrinsics.diagonal()[:2], intrinsics[:2, 2]
    low, high = (-center - MARGIN * size) / focal, (size - center + MARGIN * size) / focal
    return torch.minimum(torch.maximum(slopes, low), high)
