"""CoTracker3, for those who have the package and a checkpoint."""

import hashlib
import os
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float32

from model.errors import InputError, MissingDependencyError
from model.tracking.base import Tracker
from model.tracking.queries import check_queries
from model.types import Array, Frames, Tracks

CHECKPOINT_VARIABLE = "MATPHYS_COTRACKER"


class CoTracker(Tracker):
    """The offline predictor of the `cotracker` package, forwards and backwards from the keyframe.

    Args:
        checkpoint: `scaled_offline.pth` on this machine; else the environment's MATPHYS_COTRACKER.
        device: Where to compute; else CUDA if there is a device, else the CPU.

    Raises:
        MissingDependencyError: the package or the checkpoint is not there.

    Reference:
        Karaev et al. (2024), CoTracker3: simpler and better point tracking by pseudo-labelling
        real videos; interface: github.com/facebookresearch/co-tracker, cotracker/predictor.py.
    """

    name = "cotracker"
    version = "3"

    def __init__(self, checkpoint: Path | None = None, device: str | None = None) -> None:
        """Load the model."""
        try:
            from cotracker.predictor import CoTrackerPredictor
        except ImportError as error:
            raise MissingDependencyError(
                "tracker cotracker needs its package: "
                "pip install git+https://github.com/facebookresearch/co-tracker"
            ) from error
        named = os.environ.get(CHECKPOINT_VARIABLE)
        path = checkpoint or (Path(named) if named else None)
        if path is None or not path.is_file():
            found = "no path given" if path is None else f"no file {path}"
            raise MissingDependencyError(
                f"tracker cotracker needs a checkpoint, scaled_offline.pth ({found}): "
                f"set {CHECKPOINT_VARIABLE} to its path"
            )
        self.weights = _sha256(path)
        self._device = torch.device(device or ("cuda" if torch.cuda.is_available() else "cpu"))
        try:
            self._predictor = CoTrackerPredictor(checkpoint=str(path)).to(self._device)
        except (RuntimeError, KeyError, ValueError, OSError, EOFError) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise InputError(f"{path} is not a checkpoint of CoTracker3 offline: {reason}") from error

    def __call__(self, frames: Frames, queries: Float32[Array, "N 2"], keyframe: int) -> Tracks:
        """Track `queries` [px], given on the keyframe, through every frame.

        Raises:
            InputError: the keyframe is not in the clip, or a query is not in the image.
        """
        count, height, width = frames.images.shape[:3]
        check_queries(queries, keyframe, count, width, height)
        if len(queries) == 0:
            return Tracks(np.zeros((count, 0, 2), np.float32), np.zeros((count, 0), bool))
        # one clip [1, T, 3, H, W] in 0 … 255, queries [1, N, 3] as (frame, x, y)
        video = torch.from_numpy(frames.images).to(self._device).permute(0, 3, 1, 2)[None].float()
        asked = torch.cat(
            [torch.full((len(queries), 1), float(keyframe)), torch.from_numpy(queries)], dim=1
        ).to(self._device)
        tracks, visible = self._predictor(video, queries=asked[None], backward_tracking=True)
        points = tracks[0].float().cpu().numpy().astype(np.float32)
        seen = visible[0].cpu().numpy().astype(bool).reshape(points.shape[:2])
        finite = np.isfinite(points).all(axis=-1)
        return Tracks(np.where(finite[..., None], points, queries[None]), seen & finite)


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
