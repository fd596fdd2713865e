"""Which Gaussians touch which tile of the image, front to back."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from model.rendering.projection import Splats

TILE = 8
"""Side of a tile [px]."""
ALPHA_FLOOR = 1 / 255
"""Contributions below this opacity are exactly zero, so that every Gaussian has a finite extent."""


@dataclass(frozen=True)
class TileLists:
    """For every tile that anything touches, its Gaussians in the order of depth."""

    tiles: Int[Tensor, " M"]
    """Row-major number of the tile; the tile with the longest list comes first."""
    starts: Int[Tensor, " M"]
    """Where the list of each tile begins in `gaussians`."""
    counts: Int[Tensor, " M"]
    gaussians: Int[Tensor, " P"]
    columns: int
    """Tiles per row of the image."""
    rows: int


def extents(splats: Splats, opacities: Float[Tensor, " G"]) -> Float[Tensor, "G 2"]:
    """Half sizes [px] of the box outside which a Gaussian stays below `ALPHA_FLOOR`; 0: below all over."""
    reach = (2 * torch.log(opacities / ALPHA_FLOOR)).clamp_min(0)
    variances = splats.covariances.diagonal(dim1=1, dim2=2)
    return (reach[:, None] * variances).sqrt()


def visible(
    splats: Splats, half: Float[Tensor, "G 2"], width: int, height: int, near: float
) -> Bool[Tensor, " G"]:
    """Whether a Gaussian is in front of the camera and its box meets the image."""
    size = splats.centers.new_tensor([width - 1, height - 1])
    inside = ((splats.centers + half >= 0) & (splats.centers - half <= size)).all(dim=1)
    finite = splats.centers.isfinite().all(dim=1) & half.isfinite().all(dim=1)
    return inside & finite & (splats.depths > near) & (half > 0).all(dim=1)


def bin_into_tiles(splats: Splats, half: Float[Tensor, "G 2"], width: int, height: int) -> TileLists:
    """List the Gaussians of each tile. All of `splats` have to be visible."""
    columns, rows = -(-width // TILE), -(-height // TILE)
    order = torch.argsort(splats.depths, stable=True)
    centers, half = splats.centers[order], half[order]
    limit = torch.tensor([columns - 1, rows - 1], device=centers.device)
    # The tile whose pixels (centres at whole numbers) begin at or before the first one covered.
    first = torch.div(torch.ceil(centers - half).clamp_min(0), TILE).floor().long().minimum(limit)
    last = torch.div(torch.floor(centers + half).clamp_min(0), TILE).floor().long().minimum(limit)
    spans = (last - first + 1).clamp_min(0)

    per_gaussian = spans.prod(dim=1)
    owner = torch.repeat_interleave(torch.arange(len(order), device=order.device), per_gaussian)
    offset = torch.arange(len(owner), device=order.device) - (per_gaussian.cumsum(0) - per_gaussian)[owner]
    column = first[owner, 0] + offset % spans[owner, 0]
    row = first[owner, 1] + torch.div(offset, spans[owner, 0], rounding_mode="floor")

    tile, by_tile = torch.sort(row * columns + column, stable=True)  # stable: the order of depth stays
    tiles, counts = torch.unique_consecutive(tile, return_counts=True)
    longest_first = torch.argsort(counts, descending=True, stable=True)
    starts = (counts.cumsum(0) - counts)[longest_first]
    return TileLists(
        tiles=tiles[longest_first],
        starts=starts,
        counts=counts[longest_first],
        gaussians=order[owner[by_tile]],
        columns=columns,
        rows=rows,
    )
