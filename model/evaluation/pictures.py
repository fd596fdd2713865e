"""Metrics of pictures: what a camera would see of the prediction, and what it would see of the truth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from model.evaluation.hidden import answer
from model.evaluation.looks import looks_of
from model.evaluation.lpips import Lpips
from model.evaluation.metrics import SOLID, psnr, silhouette_iou, ssim
from model.scenes.case import Case
from model.types import Array

FRAMES = 6
"""Evenly spaced frames of each setting that are looked at."""


@dataclass(frozen=True)
class Pictures:
    """Compares pictures of cases that have looks and whose true motion is known in every frame."""

    lpips: Lpips | None = None

    def scores(
        self, case: Case, predicted: Float32[Array, "T N 3"], frames: Sequence[int]
    ) -> dict[str, float]:
        """Mean over some frames of `iou`, `psnr`, `psnr_object`, `ssim` and, with weights, `lpips`.

        Empty for a case without looks, or whose motion is not known throughout.
        """
        truth = answer(case)
        looks = looks_of(case, truth)
        if looks is None or not np.isfinite(truth).all() or not len(frames):
            return {}
        chosen = np.unique(np.linspace(frames[0], frames[-1], min(FRAMES, len(frames))).round().astype(int))
        found: dict[str, list[float]] = {}
        pairs = zip(looks.pictures(truth[chosen]), looks.pictures(predicted[chosen]), strict=True)
        for real, drawn in pairs:
            object_there = (real.alpha > SOLID) | (drawn.alpha > SOLID)
            values = {
                "iou": silhouette_iou(real.alpha, drawn.alpha),
                "psnr": psnr(real.color, drawn.color),
                "psnr_object": psnr(real.color, drawn.color, object_there),
                "ssim": ssim(real.color, drawn.color),
            }
            if self.lpips is not None:
                values["lpips"] = self.lpips.between(real.color, drawn.color)
            for name, value in values.items():
                found.setdefault(name, []).append(value)
        return {name: float(np.mean(values)) for name, values in found.items()}
