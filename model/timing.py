"""Motion at the times of a clip → motion at an even rate, which is what a bundle records."""

import numpy as np
from jaxtyping import Float32, Float64

from model.types import Array


def evenly_timed(
    motion: Float32[Array, "T C 3"], times: Float64[Array, " T"], fps: float
) -> Float32[Array, "R C 3"]:
    """Resample `motion` [m], known at `times` [s], at `fps` [1/s] from the first time on.

    A clip of constant rate keeps its frames, to the last digit.
    """
    since = times - times[0]
    count = int(np.floor(since[-1] * fps + 1e-6)) + 1
    even = np.arange(count) / fps
    if count == len(times) and np.abs(even - since).max() * fps < 1e-3:
        return motion
    flat = motion.reshape(len(times), -1).astype(np.float64)
    columns = [np.interp(even, since, column) for column in flat.T]
    resampled = np.stack(columns, axis=1) if columns else np.zeros((count, 0))
    return resampled.reshape(count, *motion.shape[1:]).astype(np.float32)
