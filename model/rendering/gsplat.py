"""The gsplat package's rasteriser, for machines with a CUDA device."""

from types import ModuleType

import torch
from jaxtyping import Float
from torch import Tensor

from model.errors import MissingDependencyError
from model.rendering.base import Renderer, Rendering
from model.rendering.projection import DILATION, NEAR, camera_tensors
from model.types import Camera


class GsplatRenderer(Renderer):
    """Rasterises on the GPU; tensors that come from the CPU are moved there and back.

    Reference:
        Ye et al. (2025), gsplat: an open-source library for Gaussian splatting.
    """

    name = "gsplat"

    def __init__(self) -> None:
        """Refuse now what could only fail after all the work.

        Raises:
            MissingDependencyError: the package or a CUDA device is absent.
        """
        super().__init__()
        self._gsplat = _import_gsplat()

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
        home, device = means.device, torch.device("cuda")
        means, scales, quaternions, opacities, colors = (
            tensor.to(device, torch.float32) for tensor in (means, scales, quaternions, opacities, colors)
        )
        intrinsics, pose = camera_tensors(camera, means)
        intrinsics = intrinsics.clone()
        intrinsics[:2, 2] += 0.5  # its first pixel has its centre at (0.5, 0.5), ours at (0, 0)
        image, alpha, _ = self._gsplat.rasterization(
            means=means,
            quats=quaternions,
            scales=scales,
            opacities=opacities,
            colors=colors,
            viewmats=torch.linalg.inv(pose)[None],
            Ks=intrinsics[None],
            width=camera.width,
            height=camera.height,
            near_plane=NEAR,
            eps2d=DILATION,
            render_mode="RGB+ED",
        )
        image, alpha = image[0].to(home), alpha[0, ..., 0].to(home)
        return Rendering(color=image[..., :3], alpha=alpha, depth=image[..., 3])


def _import_gsplat() -> ModuleType:
    try:
        import gsplat
    except ImportError as error:
        raise MissingDependencyError(
            "the gsplat renderer needs the gsplat package: pip install gsplat, or choose the renderer `splat`"
        ) from error
    if not torch.cuda.is_available():
        raise MissingDependencyError("the gsplat renderer needs a CUDA device: choose the renderer `splat`")
    module: ModuleType = gsplat
    return module
