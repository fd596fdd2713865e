"""How far a predicted motion or picture is from the true one.

Points are compared in metres, over what is known of the truth: NaN marks points that are not.
"""

import cv2
import numpy as np
from jaxtyping import Bool, Float, Float64
from scipy.spatial import cKDTree

from model.types import Array

SIGMA = 1.5
"""Standard deviation of the window of `ssim` [px]; it is cut at 11 × 11 pixels."""
C1, C2 = 0.01**2, 0.03**2
"""Constants of `ssim` for values 0..1."""
SOLID = 0.5
"""From this alpha on, a pixel belongs to a silhouette."""
PEAK_LIMIT = 60.0
"""PSNR of equal pictures [dB]: what a difference of a quarter of one of 255 steps has."""


def chamfer(truth: Float[Array, "T N 3"], predicted: Float[Array, "T M 3"]) -> Float64[Array, " T"]:
    """Mean distance from each known true point to the nearest predicted one, per frame [m].

    One-way, from what is there to what is predicted, and Euclidean. (PhysTwin's evaluation sums the absolute
    differences of the coordinates: up to √3 times as much.) NaN for frames of which nothing is known.
    """
    distances = np.full(len(truth), np.nan)
    for frame, (real, guess) in enumerate(zip(truth, predicted, strict=True)):
        known = real[np.isfinite(real).all(axis=1)]
        if len(known):
            distances[frame] = float(cKDTree(guess).query(known)[0].mean())
    return distances


def track_error(truth: Float[Array, "T N 3"], predicted: Float[Array, "T N 3"]) -> Float64[Array, " T"]:
    """Mean distance between each known true point and the same point of the prediction, per frame [m]."""
    distances = np.linalg.norm(truth.astype(np.float64) - predicted, axis=2)
    return _mean_known(distances)


def matched_track_error(
    start: Float[Array, "N 3"], truth: Float[Array, "T N 3"], predicted: Float[Array, "T N 3"]
) -> Float64[Array, " T"]:
    """As the field tracks: each point follows the predicted point that is nearest to where it was first seen.

    Args:
        start: Where each point was seen in frame 0 [m], NaN where it was not: such points do not count.
        truth: Where it really was [m].
        predicted: Where the method says that the points were; frame 0 is where points are matched [m].

    Returns:
        Mean distance per frame [m].

    Reference:
        Jiang et al. (2025), PhysTwin, section 4 (tracking error after matching the nearest vertex).
    """
    known = np.isfinite(start).all(axis=1)
    if not known.any():
        return np.full(len(truth), np.nan)
    follows = cKDTree(predicted[0]).query(start[known])[1]
    return track_error(truth[:, known], predicted[:, follows])


def silhouette_iou(real: Float[Array, "H W"], drawn: Float[Array, "H W"]) -> float:
    """Intersection over union of two silhouettes, given as alpha; two empty ones agree."""
    first, second = real > SOLID, drawn > SOLID
    union = int((first | second).sum())
    return float((first & second).sum()) / union if union else 1.0


def psnr(
    real: Float[Array, "H W 3"], drawn: Float[Array, "H W 3"], where: Bool[Array, "H W"] | None = None
) -> float:
    """Peak signal-to-noise ratio of pictures with values 0..1 [dB], at most `PEAK_LIMIT`.

    Args:
        real: The true picture.
        drawn: The predicted one.
        where: Only these pixels count. Without, the empty background counts as well, as in the tables of the
            field: a picture of a small object then scores high whatever it shows.
    """
    squares = (real.astype(np.float64) - drawn) ** 2
    squares = squares if where is None else squares[where]
    error = float(squares.mean()) if squares.size else 0.0
    return min(PEAK_LIMIT, -10.0 * float(np.log10(max(error, 1e-12))))


def ssim(real: Float[Array, "H W 3"], drawn: Float[Array, "H W 3"]) -> float:
    """Structural similarity of pictures with values 0..1: mean over pixels and channels."""
    return float(ssim_map(real, drawn).mean())


def ssim_map(real: Float[Array, "H W 3"], drawn: Float[Array, "H W 3"]) -> Float64[Array, "H W 3"]:
    """Structural similarity around each pixel.

    Reference:
        Wang et al. (2004), Image quality assessment: from error visibility to structural similarity, eq. 13.
    """
    first, second = real.astype(np.float64), drawn.astype(np.float64)
    mean_first, mean_second = _blurred(first), _blurred(second)
    variance_first = _blurred(first * first) - mean_first**2
    variance_second = _blurred(second * second) - mean_second**2
    covariance = _blurred(first * second) - mean_first * mean_second
    brightness = (2 * mean_first * mean_second + C1) / (mean_first**2 + mean_second**2 + C1)
    structure = (2 * covariance + C2) / (variance_first + variance_second + C2)
    return np.asarray(brightness * structure, np.float64)


def _blurred(image: Float64[Array, "H W 3"]) -> Float64[Array, "H W 3"]:
    return np.asarray(cv2.GaussianBlur(image, (11, 11), SIGMA, borderType=cv2.BORDER_REFLECT_101), np.float64)


def _mean_known(distances: Float64[Array, "T N"]) -> Float64[Array, " T"]:
    """Mean over the points that are known, NaN where none is."""
    known = np.isfinite(distances)
    total = np.where(known, distances, 0.0).sum(axis=1)
    count = known.sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def mean_over(frames: Float[Array, " T"]) -> float | None:
    """Mean over the frames of which something is known; None where nothing is."""
    known = frames[np.isfinite(frames)]
    return float(known.mean()) if len(known) else None
