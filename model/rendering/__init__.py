"""Gaussians → image: rasterisers, chosen by name."""

import importlib.util

import torch

from model.rendering.base import Renderer, Rendering
from model.rendering.gsplat import GsplatRenderer
from model.rendering.splat import SplatRenderer

__all__ = ["ALL_RENDERERS", "Renderer", "Rendering", "best_renderer"]

ALL_RENDERERS: tuple[type[Renderer], ...] = (SplatRenderer, GsplatRenderer)


def best_renderer() -> Renderer:
    """The fastest renderer that this machine can run."""
    if torch.cuda.is_available() and importlib.util.find_spec("gsplat") is not None:
        return GsplatRenderer()
    return SplatRenderer()
