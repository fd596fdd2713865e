"""The outline of Gaussians in an image, in plain numpy: how every method checks itself."""

import numpy as np
from jaxtyping import Bool, Float64

from model.types import Array, Camera, Gaussians


def coverage_of(gaussians: Gaussians, camera: Camera) -> Float64[Array, "H W"]:
    """Alpha of Gaussians at every pixel, 0..1; alpha needs no order of depth."""
    centers, depth = camera.project(gaussians.means)
    front = depth > 1e-6
    covariance = _image_covariance(gaussians, camera)[front]
    centers, opacity = centers[front], np.asarray(gaussians.opacities, np.float64)[front]
    conic = np.linalg.inv(covariance)
    reach = np.ceil(3.0 * np.sqrt(np.maximum(covariance[:, 0, 0], covariance[:, 1, 1]))).astype(int)
    transmission = np.zeros(camera.height * camera.width)
    for size in np.unique(np.minimum(reach, 40)):
        chosen = np.minimum(reach, 40) == size
        offset = np.stack(np.meshgrid(np.arange(-size, size + 1), np.arange(-size, size + 1)), -1).reshape(
            -1, 2
        )
        corner = np.round(centers[chosen]).astype(int)
        pixel = corner[:, None] + offset[None]
        away = pixel - centers[chosen][:, None]
        power = np.einsum("gpi,gij,gpj->gp", away, conic[chosen], away)
        alpha = np.minimum(opacity[chosen][:, None] * np.exp(-0.5 * power), 0.99)
        inside = (pixel >= 0).all(-1) & (pixel[..., 0] < camera.width) & (pixel[..., 1] < camera.height)
        inside &= alpha > 1 / 255
        index = (pixel[..., 1] * camera.width + pixel[..., 0])[inside]
        transmission += np.bincount(index, np.log1p(-alpha[inside]), minlength=len(transmission))
    coverage: Float64[Array, "H W"] = 1.0 - np.exp(transmission).reshape(camera.height, camera.width)
    return coverage


def silhouette_of(gaussians: Gaussians, camera: Camera) -> Bool[Array, "H W"]:
    """Pixels that Gaussians cover at least half."""
    inside: Bool[Array, "H W"] = coverage_of(gaussians, camera) > 0.5
    return inside


def overlap(first: Bool[Array, "H W"], second: Bool[Array, "H W"]) -> float:
    """Intersection over union of two masks; 1 when both are empty."""
    union = int(np.count_nonzero(first | second))
    return float(np.count_nonzero(first & second)) / union if union else 1.0


def _image_covariance(gaussians: Gaussians, camera: Camera) -> Float64[Array, "G 2 2"]:
    """Covariance of each Gaussian's footprint [px²], by the local affine projection.

    Reference:
        Zwicker et al. (2001), EWA volume splatting, section 6.
    """
    local = camera.to_camera(gaussians.means)
    depth = np.maximum(local[:, 2], 1e-6)
    fx, fy = camera.intrinsics[0, 0], camera.intrinsics[1, 1]
    jacobian = np.zeros((len(local), 2, 3))
    jacobian[:, 0, 0], jacobian[:, 1, 1] = fx / depth, fy / depth
    jacobian[:, 0, 2] = -fx * local[:, 0] / depth**2
    jacobian[:, 1, 2] = -fy * local[:, 1] / depth**2
    rotation = rotations_of(np.asarray(gaussians.quaternions, np.float64))
    factor = jacobian @ camera.world_from_camera[:3, :3].T @ rotation * gaussians.scales[:, None, :]
    covariance: Float64[Array, "G 2 2"] = factor @ factor.transpose(0, 2, 1) + 0.3 * np.eye(2)
    return covariance


def rotations_of(quaternions: Float64[Array, "G 4"]) -> Float64[Array, "G 3 3"]:
    """Rotation matrices of unit quaternions (w, x, y, z)."""
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
