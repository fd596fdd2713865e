"""What a prediction is judged by while it is learned: its motion, its prior, the truth where there is one."""

import math

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

NEAREST_FRAMES = 8
"""Frames whose distances between all pairs of points are held at once."""


def track_loss(
    predicted: Float[Tensor, "T N 3"],
    seen: Float[Tensor, "T N 3"],
    scale: float,
    eye: Float[Tensor, " 3"] | None = None,
) -> Float[Tensor, ""]:
    r"""How far observed points are from where they were seen, in units of `scale`.

    $\frac1n\sum \sqrt{1 + d^2/s^2} - 1$: quadratic for points that are nearly right, linear for those that
    are far off, so that one lost track or one bounce too many does not outweigh the rest.

    Args:
        predicted: [m].
        seen: [m]; NaN where not seen.
        scale: Distance s [m] beyond which an error counts linearly.
        eye: Where the only camera is [m]; then errors along its lines of sight, which it cannot measure, do
            not count.

    Reference:
        Charbonnier et al. (1994), Two deterministic half-quadratic regularization algorithms for computed
        imaging (the penalty).
    """
    known = torch.isfinite(seen).all(-1)
    if not bool(known.any()):
        return predicted.sum() * 0.0
    offset = _across(predicted[known] - seen[known], seen[known], eye)
    return _robust(offset.square().sum(-1) / scale**2).mean()


def chamfer_loss(
    predicted: Float[Tensor, "T N 3"],
    seen: Float[Tensor, "T M 3"],
    scale: float,
    eye: Float[Tensor, " 3"] | None = None,
) -> Float[Tensor, ""]:
    """How far seen points are from the nearest predicted point, in units of `scale`; see `track_loss`.

    One-way: what nobody sees may be anywhere. It does not ask which point is which, and so still points the
    right way where tracks have slid over the surface.
    """
    total, count = predicted.sum() * 0.0, 0
    for first in range(0, len(seen), NEAREST_FRAMES):
        own = slice(first, first + NEAREST_FRAMES)
        known = torch.isfinite(seen[own]).all(-1)
        if not bool(known.any()):
            continue
        nearest = _nearest(predicted[own].detach(), seen[own], eye)
        partner = torch.take_along_dim(predicted[own], nearest[..., None], dim=1)[known]
        offset = _across(partner - seen[own][known], seen[own][known], eye)
        total = total + _robust(offset.square().sum(-1) / scale**2).sum()
        count += int(known.sum())
    return total / max(count, 1)


def log_normal_divergence(
    log_mean: Float[Tensor, "*n"],
    log_spread: Float[Tensor, "*n"],
    prior_log_mean: Float[Tensor, "*n"],
    prior_log_spread: Float[Tensor, "*n"],
) -> Float[Tensor, "*n"]:
    r"""KL(predicted ‖ prior) of two log-normals.

    $\ln\frac{\sigma_p}{\sigma} + \frac{\sigma^2 + (\mu-\mu_p)^2}{2\sigma_p^2} - \frac12$: the divergence
    does not change when both variables are mapped by the logarithm, so it is that of two normals.

    Args:
        log_mean: μ, mean of the logarithm.
        log_spread: σ > 0, standard deviation of the logarithm.
        prior_log_mean: μ_p.
        prior_log_spread: σ_p > 0.

    Reference:
        Kullback and Leibler (1951), On information and sufficiency; Gil, Alajaji and Linder (2013), Rényi
        divergence measures for commonly used univariate continuous distributions (normal and log-normal).
    """
    ratio = log_spread / prior_log_spread
    shift = (log_mean - prior_log_mean) / prior_log_spread
    return 0.5 * (ratio.square() + shift.square() - 1.0) - ratio.log()


def surprise(
    mean: Float[Tensor, "*n"], spread: Float[Tensor, "*n"], truth: Float[Tensor, "*n"]
) -> Float[Tensor, ""]:
    r"""Mean negative log-likelihood of the truth under normal beliefs; zero where no truth is known.

    $\frac{(x-\mu)^2}{2\sigma^2} + \ln\sigma + \frac12\ln 2\pi$

    Args:
        mean: μ.
        spread: σ > 0.
        truth: x; NaN where it is not known.
    """
    known = torch.isfinite(truth)
    if not bool(known.any()):
        return mean.sum() * 0.0 + spread.sum() * 0.0
    scaled = (truth[known] - mean[known]) / spread[known]
    return (0.5 * scaled.square() + spread[known].log()).mean() + 0.5 * math.log(2.0 * math.pi)


def covered(
    mean: Float[Tensor, "*n"], spread: Float[Tensor, "*n"], truth: Float[Tensor, "*n"], share: float = 0.9
) -> Bool[Tensor, "*n"]:
    """Whether the central interval that ought to hold `share` of all truths holds this one."""
    reach = math.sqrt(2.0) * float(torch.erfinv(torch.tensor(share, dtype=torch.float64)))
    return (truth - mean).abs() <= reach * spread


def _robust(square: Tensor) -> Tensor:
    return (1.0 + square).sqrt() - 1.0


def _across(offset: Tensor, seen: Tensor, eye: Tensor | None) -> Tensor:
    """The share of offsets that is perpendicular to the line of sight through the seen points."""
    if eye is None:
        return offset
    sight = torch.nn.functional.normalize(seen - eye, dim=-1)
    return offset - (offset * sight).sum(-1, keepdim=True) * sight


def _nearest(
    predicted: Float[Tensor, "t N 3"], seen: Float[Tensor, "t M 3"], eye: Tensor | None
) -> Int64[Tensor, "t M"]:
    """The predicted point that is nearest to each seen one, across the line of sight through it."""
    offset = predicted[:, None, :, :] - seen.nan_to_num()[:, :, None, :]
    square = _across(offset, seen.nan_to_num()[:, :, None, :], eye).square().sum(-1)
    return square.argmin(-1)
