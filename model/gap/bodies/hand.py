"""Where a hand really was: its controllers as they were measured, less the noise of the measurement."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64
from scipy.linalg import cho_solve_banded, cholesky_banded

from model.types import Array

ORDER = 3
"""Motion is smooth in its third differences: hands that reach for something change their jerk least."""
MEMORIES = (0.0, 0.2, 0.4)
"""Correlations of the noise from frame to frame that are tried. Beyond, noise cannot be told from motion."""
SMOOTHNESS = tuple(np.logspace(-5.0, 5.0, 31).tolist())
"""Variances of the noise over those of third differences of the motion that are tried."""
TINY = 1e-30
"""[m²] in all: of hands that do not move."""
FARTHEST = 5.0
"""Noise is nowhere so many times its median. Where more is taken for noise a hand was jolted, and such a
motion is left as it was measured."""
LOUDEST = 0.003
"""Standard deviation of a coordinate [m]: who measures a hand errs by less. More than that is no noise but a
fast shake, which third differences cannot tell from it."""
NEXT = 1e-3
"""Frames that follow each other within this share of the usual interval are one, and tell no motion."""


def steadied(controllers: Float[Array, "T C 3"], times: Float64[Array, " T"]) -> Float64[Array, "T C 3"]:
    r"""Controllers without the noise of their measurement, as they were in the first frame.

    Measured c = x + n: third differences of the motion x are independent, of variance q; the noise n has
    variance r and keeps a share m from frame to frame. What is measured tells r / q and m: those under which
    it is likeliest, for all controllers together; x is where they most probably were. A twin that is driven
    by c itself is shaken by n.

    Args:
        controllers: As measured [m].
        times: Of the frames [s], increasing.

    Returns:
        Their places [m]; all are shifted by what the first frame was measured wrong, as if it had not been.

    Reference:
        Wahba (1985), A comparison of GCV and GML for choosing the smoothing parameter in the generalized
        spline smoothing problem, Annals of Statistics 13 (generalised maximum likelihood).
    """
    measured = controllers.astype(np.float64)
    frames = len(measured)
    if frames <= 2 * ORDER or measured.shape[1] == 0:
        return measured
    intervals = np.diff(times)
    if intervals.min() < NEXT * np.median(intervals):
        return measured
    middle = measured.mean(0)
    series = (measured - middle).reshape(frames, -1)
    roughness = _roughness(times)
    tried = (_smoothed(series, roughness, ratio, memory) for memory in MEMORIES for ratio in SMOOTHNESS)
    best = min(tried, key=lambda one: one.unlikely)
    noise = measured - middle - best.series.reshape(measured.shape)
    size = np.linalg.norm(noise, axis=2)
    loud = float(np.sqrt(np.square(noise).mean())) > LOUDEST
    if loud or size.max() > FARTHEST * np.median(size):
        return measured
    places: Float64[Array, "T C 3"] = measured - noise + noise[0]
    return places


@dataclass(frozen=True)
class _Smoothed:
    series: Float64[Array, "T n"]
    unlikely: float
    """Twice the negative logarithm of the restricted likelihood of what was measured, for each series."""


def _smoothed(
    series: Float64[Array, "T n"], roughness: Float64[Array, "k T"], ratio: float, memory: float
) -> _Smoothed:
    """Where motion most probably was, of a noise of this variance over the motion's and this memory."""
    frames, count = series.shape
    fresh = 1.0 - memory**2
    noise = np.zeros_like(roughness)  # the inverse of a correlation memory^|i - j| has three diagonals
    noise[0] = (1.0 + memory**2) / fresh
    noise[0, [0, -1]] = 1.0 / fresh
    noise[1, :-1] = -memory / fresh
    weighed = noise[0][:, None] * series
    weighed[1:] += noise[1, :-1, None] * series[:-1]
    weighed[:-1] += noise[1, :-1, None] * series[1:]
    factor = cholesky_banded(noise + ratio * roughness, lower=True)
    smooth: Float64[Array, "T n"] = cho_solve_banded((factor, True), weighed)
    left = max(float(((series - smooth) * weighed).sum()), TINY) / count
    determinant = 2.0 * float(np.log(factor[0]).sum()) + (frames - 1) * float(np.log(fresh))
    return _Smoothed(smooth, (frames - ORDER) * float(np.log(left / ratio)) + determinant)


def _roughness(times: Float64[Array, " T"]) -> Float64[Array, "k T"]:
    """Lower diagonals of the sum of squared third differences, divided ones where frames are not even."""
    frame = (times - times[0]) / np.median(np.diff(times))
    rows = len(frame) - ORDER
    four = np.stack([frame[i : i + rows] for i in range(ORDER + 1)], axis=1)
    apart = four[:, :, None] - four[:, None, :] + np.eye(ORDER + 1)
    weight = 6.0 / apart.prod(2)
    diagonals = np.zeros((ORDER + 1, len(frame)))
    for first in range(ORDER + 1):
        for second in range(first, ORDER + 1):
            product = weight[:, first] * weight[:, second]
            diagonals[second - first, first : first + rows] += product
    return diagonals
