"""The default renderer: Gaussian splatting in plain torch, on any device."""

import torch
from jaxtyping import Float, Int
from torch import Tensor

from model.rendering.base import Renderer, Rendering
from model.rendering.projection import NEAR, Splats, project
from model.rendering.tiles import ALPHA_FLOOR, TILE, TileLists, bin_into_tiles, extents, visible
from model.types import Camera

ALPHA_CEILING = 0.999
"""No Gaussian hides what is behind it entirely, so that gradients pass."""
BATCH, CHUNK = 128, 16
"""Tiles and Gaussians composited at a time: their product over the pixels fits the cache."""


class SplatRenderer(Renderer):
    r"""Front-to-back alpha compositing of projected Gaussians, tile by tile.

    $C = \sum_i c_i \alpha_i \prod_{j<i} (1-\alpha_j)$ in the order of depth of the means, with
    $\alpha_i = o_i \exp(-\tfrac12 d^T \Sigma_i'^{-1} d)$, zero below 1/255.

    Args:
        transmittance_floor: A tile is finished once every pixel of it lets through less than this;
            0 composites everything.

    Reference:
        Kerbl et al. (2023), 3D Gaussian splatting for real-time radiance field rendering, eq. 3.
    """

    name = "splat"

    def __init__(self, transmittance_floor: float = 1e-4) -> None:
        """Remember when a tile is finished."""
        super().__init__()
        self.transmittance_floor = transmittance_floor

    def forward(
        self,
        means: Float[Tensor, "G 3"],
        scales: Float[Tensor, "G 3"],
        quaternions: Float[Tensor, "G 4"],
        opacities: Float[Tensor, " G"],
        colors: Float[Tensor, "G 3"],
        camera: Camera,
    ) -> Rendering:
        """Render from `camera` at its own resolution."""
        with torch.no_grad():
            splats = project(means, scales, quaternions, camera)
            half = extents(splats, opacities)
            seen = visible(splats, half, camera.width, camera.height, NEAR).nonzero().squeeze(1)
        if torch.is_grad_enabled():
            splats = project(means[seen], scales[seen], quaternions[seen], camera)
        else:
            splats = Splats(splats.centers[seen], splats.covariances[seen], splats.depths[seen])
        with torch.no_grad():
            lists = bin_into_tiles(splats, half[seen], camera.width, camera.height)
        quadratic = _quadratics(splats, opacities[seen])
        payload = torch.cat(
            [colors[seen], torch.ones_like(splats.depths)[:, None], splats.depths[:, None]], dim=1
        )
        image = self._composite(lists, quadratic, payload)[: camera.height, : camera.width]
        alpha, weighted_depth = image[..., 3], image[..., 4]
        depth = weighted_depth / torch.where(alpha > 0, alpha, torch.ones_like(alpha))
        return Rendering(color=image[..., :3], alpha=alpha, depth=depth)

    def _composite(
        self, lists: TileLists, quadratic: Float[Tensor, "V 6"], payload: Float[Tensor, "V C"]
    ) -> Float[Tensor, "H W C"]:
        """The whole image, padded to full tiles."""
        channels = payload.shape[1]
        image = payload.new_zeros(lists.rows * lists.columns, TILE * TILE, channels)
        # One more row that touches nothing: what fills short lists up.
        nothing = quadratic.new_zeros(1, 6)
        nothing[0, 0] = -1e4
        quadratic = torch.cat([quadratic, nothing])
        payload = torch.cat([payload, payload.new_zeros(1, channels)])
        every = torch.arange(len(lists.tiles), device=payload.device)
        finished = [
            self._composite_batch(lists, every[begin : begin + BATCH], quadratic, payload)
            for begin in range(0, len(every), BATCH)
        ]
        if finished:
            done, values = (torch.cat(tensors) for tensors in zip(*finished, strict=True))
            image = image.index_copy(0, lists.tiles[done], values)
        image = image.view(lists.rows, lists.columns, TILE, TILE, channels).transpose(1, 2)
        return image.reshape(lists.rows * TILE, lists.columns * TILE, channels)

    def _composite_batch(
        self,
        lists: TileLists,
        batch: Int[Tensor, " B"],
        quadratic: Float[Tensor, "V 6"],
        payload: Float[Tensor, "V C"],
    ) -> tuple[Int[Tensor, " B"], Float[Tensor, "B P C"]]:
        """Composite some tiles, `CHUNK` Gaussians at a time; finished tiles leave early."""
        basis, corners = _pixel_basis(quadratic), _corners(lists, batch).to(quadratic)
        transmittance = quadratic.new_ones(len(batch), TILE * TILE)
        total = payload.new_zeros(len(batch), TILE * TILE, payload.shape[1])
        done, values = [], []
        for begin in range(0, int(lists.counts[batch[0]]) + CHUNK, CHUNK):
            with torch.no_grad():
                open_ = lists.counts[batch] > begin
                open_ &= transmittance.amax(dim=1) > self.transmittance_floor
            if not bool(open_.all()):
                done.append(batch[~open_])
                values.append(total[~open_])
                batch, corners = batch[open_], corners[open_]
                transmittance, total = transmittance[open_], total[open_]
                if len(batch) == 0:
                    break
            members = _members(lists, batch, begin, len(payload) - 1)
            alpha = _alphas(_moved(quadratic[members], corners), basis)
            through = torch.cumprod(1 - alpha, dim=1)
            before = torch.cat([torch.ones_like(through[:, :1]), through[:, :-1]], dim=1)
            weight = alpha * before * transmittance[:, None]
            total = total + weight.transpose(1, 2) @ payload[members]
            transmittance = transmittance * through[:, -1]
        return torch.cat(done), torch.cat(values)


def _quadratics(splats: Splats, opacities: Float[Tensor, " V"]) -> Float[Tensor, "V 6"]:
    """Log α as a polynomial in the pixel: centre u, v, then a, b, c of the inverse covariance, log o.

    The polynomial is expanded per tile, about the tile's own centre, where float32 is precise.
    """
    (xx, xy), (_, yy) = (row.unbind(1) for row in splats.covariances.unbind(1))
    determinant = xx * yy - xy * xy
    u, v = splats.centers.unbind(1)
    return torch.stack(
        [torch.log(opacities), u, v, yy / determinant, -xy / determinant, xx / determinant], dim=1
    )


def _moved(quadratic: Float[Tensor, "B K 6"], corners: Float[Tensor, "B 2"]) -> Float[Tensor, "B K 6"]:
    """Coefficients of 1, x, y, x², xy, y², with x and y relative to `corners` [px]."""
    log_opacity, u, v, a, b, c = quadratic.unbind(-1)
    u, v = u - corners[:, None, 0], v - corners[:, None, 1]
    x, y = a * u + b * v, b * u + c * v
    return torch.stack([log_opacity - 0.5 * (u * x + v * y), x, y, -0.5 * a, -b, -0.5 * c], dim=-1)


def _alphas(coefficients: Float[Tensor, "B K 6"], basis: Float[Tensor, "6 P"]) -> Float[Tensor, "B K P"]:
    """Opacity of each Gaussian at each pixel of its tile."""
    alpha = torch.exp(coefficients @ basis).clamp_max(ALPHA_CEILING)
    return torch.where(alpha < ALPHA_FLOOR, torch.zeros_like(alpha), alpha)


def _pixel_basis(like: Tensor) -> Float[Tensor, "6 P"]:
    """1, x, y, x², xy, y² of the pixels of a tile, relative to its middle."""
    offsets = torch.arange(TILE).to(like) - TILE / 2
    y, x = (grid.reshape(-1) for grid in torch.meshgrid(offsets, offsets, indexing="ij"))
    return torch.stack([torch.ones_like(x), x, y, x * x, x * y, y * y])


def _corners(lists: TileLists, batch: Int[Tensor, " B"]) -> Int[Tensor, "B 2"]:
    """Pixel coordinates of the middle of each tile."""
    tiles = lists.tiles[batch]
    column, row = tiles % lists.columns, torch.div(tiles, lists.columns, rounding_mode="floor")
    return torch.stack([column, row], dim=1) * TILE + TILE // 2


def _members(lists: TileLists, batch: Int[Tensor, " B"], begin: int, filler: int) -> Int[Tensor, "B K"]:
    """The next `CHUNK` Gaussians of each tile; `filler` where its list has ended."""
    place = begin + torch.arange(CHUNK, device=batch.device).expand(len(batch), CHUNK)
    inside = place < lists.counts[batch][:, None]
    index = (lists.starts[batch][:, None] + place).clamp_max(len(lists.gaussians) - 1)
    return torch.where(inside, lists.gaussians[index], filler)
