"""Unit quaternions (w x y z) in torch: products, matrices, and the rotation nearest to a matrix."""

import torch
from jaxtyping import Float
from torch import Tensor


def matrices(quaternions: Float[Tensor, "*n 4"]) -> Float[Tensor, "*n 3 3"]:
    """Rotation matrices of quaternions of any length but zero."""
    w, x, y, z = (quaternions / quaternions.norm(dim=-1, keepdim=True)).unbind(-1)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)


def multiply(left: Float[Tensor, "*n 4"], right: Float[Tensor, "*n 4"]) -> Float[Tensor, "*n 4"]:
    """The rotation that does `right` first, then `left`."""
    a, b, c, d = left.unbind(-1)
    w, x, y, z = right.unbind(-1)
    product = (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )
    return torch.stack(product, dim=-1)


def nearest_rotations(deformation: Float[Tensor, "N 3 3"]) -> Float[Tensor, "N 4"]:
    r"""The rotation R that maximises $\mathrm{tr}(R^T A)$, never a mirror image; w ≥ 0.

    It is the polar decomposition's: the eigenvector of the largest eigenvalue of a symmetric 4×4
    matrix that is linear in A, well defined for flat neighbourhoods too. Its derivative goes through
    that eigenvector alone, so equal smaller eigenvalues (which symmetric surroundings have) do no harm.

    Args:
        deformation: A = Σ (moved offset) (rest offset)ᵀ.

    Reference:
        Horn (1987), Closed-form solution of absolute orientation using unit quaternions, section 4A.
    """
    matrix = _horn_matrix(deformation)
    with torch.no_grad():
        values, vectors = torch.linalg.eigh(matrix)
        best = vectors[..., -1]
        best = torch.where(best[..., :1] < 0, -best, best)
    if not (torch.is_grad_enabled() and deformation.requires_grad):
        return best
    # d q = (λ - M)⁺ dM q. The product with M q itself is zero, so the value stays the eigenvector.
    with torch.no_grad():
        gaps = (values[..., -1:] - values[..., :3]).clamp_min(1e-9 * values[..., -1:].abs() + 1e-30)
        response = (vectors[..., :3] / gaps[..., None, :]) @ vectors[..., :3].transpose(-1, -2)
    followed: Tensor = best + (response @ matrix @ best[..., None]).squeeze(-1)
    return followed


def _horn_matrix(deformation: Float[Tensor, "N 3 3"]) -> Float[Tensor, "N 4 4"]:
    """The quadratic form q ↦ tr(R(q)ᵀ A) on unit quaternions."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (row.unbind(-1) for row in deformation.unbind(-2))
    rows = (
        (xx + yy + zz, zy - yz, xz - zx, yx - xy),
        (zy - yz, xx - yy - zz, xy + yx, xz + zx),
        (xz - zx, xy + yx, yy - xx - zz, yz + zy),
        (yx - xy, xz + zx, yz + zy, zz - xx - yy),
    )
    return torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)
