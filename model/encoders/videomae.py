"""VideoMAE's tokens of a clip, taken where the points of the object are in the image."""

import os
from pathlib import Path
from typing import ClassVar

import cv2
import numpy as np
import torch
from jaxtyping import Float32, Float64, Int, UInt8
from torch import Tensor
from torch.nn.functional import grid_sample, layer_norm

from model.encoders.motion import EncodedMotion, MotionClip, MotionEncoder
from model.encoders.weights_folder import IMAGENET_MEAN, IMAGENET_STD, load_network
from model.errors import InputError, MissingDependencyError
from model.types import Array

WEIGHTS_VARIABLE = "MATPHYS_VIDEOMAE"
WHO = "videomae motion encoder"
FRAMES = 32
"""Of the clip, evenly spaced."""
MARGIN = 1.4
"""Side of the square that is looked at over the extent of the object's path through the image."""


class VideoMaeEncoder(MotionEncoder):
    """Tokens of a frozen VideoMAE: 32 frames of a square around the object, as many at a time as it knows.

    A point's features are the mean of the tokens where it was seen in the image, frame by frame; the clip's
    are the mean of all. Each is normalised to mean 0 and variance 1. Where a point is not seen, its place
    between the frames in which it was is taken; a point that never was is where it lies at rest.

    The folder is what the hub calls a model, for example
    `huggingface-cli download MCG-NJU/videomae-base --local-dir FOLDER`; a name on the hub is fetched there.

    Reference:
        Tong, Song, Wang and Wang (2022), VideoMAE: masked autoencoders are data-efficient learners for
        self-supervised video pre-training.
    """

    name: ClassVar[str] = "videomae"
    version: ClassVar[str] = "1"
    needs_images: ClassVar[bool] = True

    def __init__(self, source: str | Path | None = None) -> None:
        """Load the weights.

        Args:
            source: Folder of the weights, or a name on the hub (`OWNER/NAME`); left out, the environment
                variable `MATPHYS_VIDEOMAE` says it.

        Raises:
            InputError: no source was given, or it holds no VideoMAE that can look at 32 frames.
            MissingDependencyError: transformers is not installed.
        """
        super().__init__()
        chosen = source or os.environ.get(WEIGHTS_VARIABLE)
        if not chosen:
            raise InputError(f"{WHO}: no weights; set {WEIGHTS_VARIABLE} to a folder of the model")
        folder = _folder(chosen)
        self.network, self.weights = load_network(folder, {"videomae": "VideoMAEModel"}, WHO, "VideoMAE")
        config = self.network.config
        self.side, self.patch = int(config.image_size), int(config.patch_size)
        self.tubelet, self.at_once = int(config.tubelet_size), int(config.num_frames)
        if FRAMES % self.at_once:
            raise InputError(f"{WHO}: {chosen} looks at {self.at_once} frames; {FRAMES} are not a multiple")
        self.dim = self.global_dim = int(config.hidden_size)

    def forward(self, clip: MotionClip) -> EncodedMotion:
        """Describe a clip; there are no features per part.

        Raises:
            InputError: the clip has no images, or no camera to find points in them.
        """
        if clip.images is None or clip.camera is None:
            raise InputError(f"{WHO}: the clip comes without images or without their camera")
        chosen = np.linspace(0, len(clip.images) - 1, FRAMES).round().astype(np.int64)
        pixels, _ = clip.camera.project(_filled(clip.points, clip.rest))
        scale = np.array(clip.images.shape[2:0:-1]) / (clip.camera.width, clip.camera.height)
        pixels = (pixels + 0.5) * scale - 0.5
        corner, side = _square(pixels)
        tokens = self._tokens(_cut(clip.images[chosen], corner, side, self.side))
        # where a point is in the square, -1 to 1, at the middle of each tubelet
        places = (2.0 * (pixels[chosen] - corner) / side - 1.0).reshape(-1, self.tubelet, len(clip.rest), 2)
        grid = torch.as_tensor(places.mean(axis=1), dtype=torch.float32)[:, None]
        found = grid_sample(tokens, grid, padding_mode="border", align_corners=False)[:, :, 0]
        return EncodedMotion(
            points=_normal(found.mean(dim=0).T),
            parts=np.zeros((clip.parts, 0), np.float32),
            whole=_normal(tokens.mean(dim=(0, 2, 3))),
        )

    def _tokens(self, video: Float32[Tensor, "F 3 s s"]) -> Float32[Tensor, "U D h w"]:
        """A map of tokens per tubelet."""
        batch = video.reshape(-1, self.at_once, 3, self.side, self.side)
        with torch.no_grad():
            states: Tensor = self.network(pixel_values=batch).last_hidden_state
        rows = self.side // self.patch
        return states.reshape(FRAMES // self.tubelet, rows, rows, self.dim).permute(0, 3, 1, 2)


def _folder(source: str | Path) -> Path:
    """The folder itself, or where the hub's client keeps what has that name."""
    path = Path(source).expanduser()
    if path.is_dir() or str(source).count("/") != 1 or str(source).startswith((".", "/", "~")):
        return path
    try:
        from huggingface_hub import snapshot_download
    except ImportError:
        raise MissingDependencyError(f"{WHO} needs transformers: pip install 'matphys[weights]'") from None
    try:
        return Path(snapshot_download(str(source), allow_patterns=["config.json", "model.safetensors"]))
    except Exception as error:  # the client raises errors of several libraries
        line = " ".join(f"{error}".split())[:200] or type(error).__name__
        raise InputError(f"{WHO}: {source} is no folder and cannot be had from the hub: {line}") from None


def _filled(points: Float32[Array, "T N 3"], rest: Float32[Array, "N 3"]) -> Float32[Array, "T N 3"]:
    """Gaps bridged in a straight line [m]; what was never seen is at rest."""
    filled = np.repeat(rest[None], len(points), axis=0)
    frames = np.arange(len(points))
    for number in range(len(rest)):
        seen: Int[Array, " m"] = np.flatnonzero(np.isfinite(points[:, number]).all(axis=-1))
        if len(seen):
            for axis in range(3):
                filled[:, number, axis] = np.interp(frames, seen, points[seen, number, axis])
    return filled


def _square(pixels: Float64[Array, "T N 2"]) -> tuple[Float64[Array, " 2"], float]:
    """Upper left corner and side of a square around all that the points pass [px], edges of pixels."""
    low, high = pixels.min(axis=(0, 1)), pixels.max(axis=(0, 1))
    side = max(MARGIN * float((high - low).max()), 16.0)
    return (low + high) / 2.0 - side / 2.0, side


def _cut(
    images: UInt8[Array, "F H W 3"], corner: Float64[Array, " 2"], side: float, size: int
) -> Float32[Tensor, "F 3 s s"]:
    """The square of each image in `size` × `size` pixels, normalised as in training; outside is black."""
    zoom = size / side
    # centres of pixels are whole numbers: (p - corner) · zoom - ½
    matrix = np.array([[zoom, 0.0, -corner[0] * zoom - 0.5], [0.0, zoom, -corner[1] * zoom - 0.5]])
    if zoom < 1.0:  # blur what would alias
        images = np.stack([cv2.GaussianBlur(image, (0, 0), 0.5 / zoom) for image in images])
    cut = np.stack([cv2.warpAffine(image, matrix, (size, size), flags=cv2.INTER_LINEAR) for image in images])
    normal = (cut.astype(np.float32) / 255.0 - np.array(IMAGENET_MEAN, np.float32)) / np.array(
        IMAGENET_STD, np.float32
    )
    return torch.from_numpy(np.ascontiguousarray(normal.transpose(0, 3, 1, 2)))


def _normal(features: Float32[Tensor, "*n D"]) -> Float32[Array, "*n D"]:
    normalised: Float32[Array, "*n D"] = layer_norm(features, features.shape[-1:]).numpy()
    return normalised
