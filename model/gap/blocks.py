"""How much residuals say that hang together in time and space, and intervals that allow for it."""

import numpy as np
from jaxtyping import Bool, Float64, Int64

from model.types import Array

DRAWS = 2000
"""Of a bootstrap."""
FEWEST = 8
"""Blocks that an interval needs at least; blocks are made shorter for it."""
NEGLIGIBLE = 0.05
"""An autocorrelation below it is none."""


def block_length(frames: int, wanted: int) -> int:
    """Frames in a block: as many as wanted where that leaves enough blocks."""
    return max(1, min(wanted, frames // FEWEST))


def drawn_frames(frames: int, length: int, draws: int = DRAWS) -> Float64[Array, "d F"]:
    """How often each frame is drawn, in each of many draws of blocks that wrap around the end.

    Reference:
        Politis and Romano (1992), A circular block-resampling procedure for stationary data, in Exploring the
        limits of bootstrap, 263-270.
    """
    rng = np.random.default_rng(0)
    count = int(np.ceil(frames / length))
    starts = rng.integers(0, frames, (draws, count, 1))
    chosen = ((starts + np.arange(length)) % frames).reshape(draws, -1)[:, :frames]
    rows = np.repeat(np.arange(draws), chosen.shape[1])
    times = np.zeros((draws, frames))
    np.add.at(times, (rows, chosen.ravel()), 1.0)
    return times


def middle95(values: Float64[Array, " d"]) -> tuple[float, float]:
    """Between these two lie 95 % of the values."""
    low, high = np.quantile(values, (0.025, 0.975))
    return float(low), float(high)


def correlation_time(field: Float64[Array, "F N k"], seen: Bool[Array, "F N"]) -> float:
    """How many frames say as much as one independent frame: 1 + 2 Σ autocorrelation.

    The sum ends where the autocorrelation is negligible.

    Args:
        field: Residuals, zero where nothing was seen.
        seen: Where something was.

    Reference:
        Geyer (1992), Practical Markov chain Monte Carlo, Statistical science 7, section 3.3 (where to end).
    """
    power = float((field**2).sum()) / max(int(seen.sum()), 1)
    total = 1.0
    for lag in range(1, len(field) // 2):
        pairs = int((seen[lag:] & seen[:-lag]).sum())
        product = float((field[lag:] * field[:-lag]).sum()) / max(pairs, 1)
        if product <= NEGLIGIBLE * power:
            break
        total += 2.0 * product / power
    return total


def independent_share(field: Float64[Array, "F N k"], seen: Bool[Array, "F N"]) -> float:
    r"""Share of the residuals that are independent of each other, 0..1, in time and among points.

    Among points it is the participation ratio $(\mathrm{tr}\,C)^2 / (N\,\mathrm{tr}\,C^2)$ of their
    covariance C, less what so few frames would give by chance; points that are never seen have no residuals.

    Args:
        field: Residuals, zero where nothing was seen.
        seen: Where something was.

    Reference:
        Bretherton et al. (1999), The effective number of spatial degrees of freedom of a time-varying field,
        Journal of climate 12.
    """
    ever = seen.any(0)
    field, seen = field[:, ever], seen[:, ever]
    frames, points, axes = field.shape
    time = correlation_time(field, seen)
    rows = field.transpose(0, 2, 1).reshape(-1, points)
    covariance = rows.T @ rows / len(rows)
    trace, square = float(np.trace(covariance)), float((covariance**2).sum())
    if trace == 0.0:
        return 1.0
    by_chance = trace**2 * time / (frames * axes)
    among = trace**2 / max(square - by_chance, trace**2 / points)
    return float(np.clip(among / points / time, 1.0 / (points * frames), 1.0))


def jackknife(
    normals: Float64[Array, "B d d"],
    slopes: Float64[Array, "B d"],
    prior: Float64[Array, "d d"],
    scatter: Float64[Array, "d d"] | None = None,
) -> Float64[Array, "d d"]:
    """Covariance of a least-squares estimate from what it would be without each block in turn.

    It needs no model of the noise: blocks are only taken to be independent of each other. With few blocks it
    errs on the wide side, where a sandwich of the same blocks errs on the narrow one. What is believed
    beforehand counts as one more observation: what no block speaks of is known no better than that.

    Args:
        normals: Jᵀ J of each block.
        slopes: Jᵀ r of each block, at the estimate.
        prior: Jᵀ J of what is believed beforehand, which was fitted along.
        scatter: Covariance of its Jᵀ r; None: of residuals of variance 1, that is `prior`.

    Reference:
        MacKinnon, Nielsen and Webb (2023), Cluster-robust inference: a guide to empirical practice,
        Journal of econometrics 232 (the cluster jackknife, CV3).
    """
    count = len(normals)
    whole, total = normals.sum(0) + prior, slopes.sum(0)
    moved = np.stack([-np.linalg.solve(whole - n, total - s) for n, s in zip(normals, slopes, strict=True)])
    apart = moved - moved.mean(0)
    inverse = np.linalg.inv(whole)
    believed = inverse @ (prior if scatter is None else scatter) @ inverse
    covariance: Float64[Array, "d d"] = (count - 1) / count * apart.T @ apart + believed
    return covariance


def blocks_of(frames: Int64[Array, " m"], length: int) -> Int64[Array, " m"]:
    """Which block each residual belongs to, of its frame; blocks count from 0, and a short last one joins."""
    block = (frames - frames.min()) // length
    last = (frames.max() + 1 - frames.min()) // length - 1
    joined: Int64[Array, " m"] = np.minimum(block, max(int(last), 0)).astype(np.int64)
    return joined
