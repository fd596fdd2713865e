"""How far the gap shrinks: errors on what no fit has seen, the floor below them, and their intervals."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from jaxtyping import Float64

from model.gap.blocks import block_length, drawn_frames, middle95
from model.gap.confirm import Fitted
from model.gap.forecast import Forecast, forecast
from model.gap.schema import Closure
from model.gap.study import Study
from model.gap.transfer import Transferred
from model.types import Array

Interval: TypeAlias = tuple[float, float]

BLOCK = 0.2
"""Of a bootstrap [s]: the time in which errors hang together."""
MEAN_DISTANCE = 2.0 * float(np.sqrt(2.0 / np.pi))
"""Of places that are off by noise of standard deviation 1 along each axis (the Maxwell distribution)."""


@dataclass(frozen=True)
class Closed:
    """How far the gap shrinks, and what was foretold."""

    closure: Closure
    intervals: dict[str, Interval]
    """95 % intervals [m] of its errors, by key."""
    baseline: Forecast
    refit: Forecast
    with_effect: Forecast | None

    @property
    def idle(self) -> bool:
        """The effect cannot act here: the twin with it is the refitted one."""
        return self.with_effect is self.refit


@dataclass(frozen=True)
class Foretold:
    """Forecasts of the same frames by twins that were fitted to others."""

    baseline: Forecast
    refit: Forecast
    with_effect: Forecast | None
    flexible: Forecast | None
    """By the flexible residual force."""


def closure(
    study: Study, plain: Fitted, with_effect: Fitted | None = None, flexible: Fitted | None = None
) -> Closed:
    """How far the gap shrinks on the held-out time of the recording that was fitted.

    Errors are mean distances of visible points in free runs of at most `forecast.WINDOW`, each from the state
    to which an observer led the twin. The ceiling is the flexible force's error, or the refitted twin's where
    the force has learned what does not hold later.

    Args:
        study: Which frames are held out, and the twin as it came.
        plain: From `confirm.refit`.
        with_effect: From `confirm.confirm`; None: the verdict has no effect.
        flexible: From `ceiling.ceiling`; None: not determined.
    """
    foretold = Foretold(
        forecast(study.observer, study.plain.at(study.start), study.split),
        plain.foretold,
        None if with_effect is None else with_effect.foretold,
        None if flexible is None else flexible.foretold,
    )
    return _closed(study.observation.times, study.noise, foretold)


def transfer(
    study: Study,
    other: Transferred,
    refitted: Forecast,
    with_effect: Fitted | None = None,
    flexible: Fitted | None = None,
) -> Closed:
    """The same on another recording, to which nothing is fitted but how the body lies and is held there.

    That is fitted to each twin by itself, to the frames before those that are foretold.

    Args:
        study: The twin as it came.
        other: The other recording.
        refitted: What the plain twin from `confirm.refit` foretells there.
        with_effect: From `confirm.confirm`; None: the verdict has no effect. With one that cannot act there,
            as what the ground does cannot in the air, the twin is the refitted one.
        flexible: From `ceiling.ceiling`; None: not determined.
    """

    def there(one: Fitted | None) -> Forecast | None:
        return None if one is None else other.forecast(one.hypothesis, one.estimate.values)

    idle = with_effect is not None and not other.hypothesis(with_effect.hypothesis).effects
    foretold = Foretold(
        other.forecast(study.plain, study.start),
        refitted,
        refitted if idle else there(with_effect),
        there(flexible),
    )
    return _closed(other.twin.observation.times, other.noise, foretold)


def _closed(times: Float64[Array, " T"], noise: float, foretold: Foretold) -> Closed:
    floor = MEAN_DISTANCE * noise
    refit, with_effect, flexible = foretold.refit, foretold.with_effect, foretold.flexible
    first = refit.first
    usual = float(np.median(np.diff(times)))
    frames = len(times) - first
    weights = drawn_frames(frames, block_length(frames, max(1, round(BLOCK / usual))))
    kept = {"baseline": foretold.baseline, "refit": refit}
    if with_effect is not None:
        kept["with_effect"] = with_effect
    if flexible is not None:
        kept["ceiling"] = min(flexible, refit, key=lambda one: one.error)
    means = {name: _means(one, weights) for name, one in kept.items()}
    fraction, interval = None, None
    reducible = means["refit"] - floor
    if with_effect is not None and middle95(reducible)[0] > 0.0:
        fraction = (refit.error - with_effect.error) / (refit.error - floor)
        interval = middle95((means["refit"] - means["with_effect"]) / np.maximum(reducible, 1e-3 * floor))
    figures = Closure(
        baseline=foretold.baseline.error,
        refit=refit.error,
        with_effect=None if with_effect is None else with_effect.error,
        noise_floor=floor,
        ceiling=kept["ceiling"].error if flexible is not None else None,
        closed_fraction=fraction,
        closed_fraction_ci95=interval,
        heldout=((float(times[first]), float(times[-1])),),
    )
    intervals = {name: middle95(drawn) for name, drawn in means.items()}
    return Closed(figures, intervals, foretold.baseline, refit, with_effect)


def _means(one: Forecast, weights: Float64[Array, "d F"]) -> Float64[Array, " d"]:
    """Mean distance of visible points over drawn frames [m]."""
    sums, counts = np.nansum(one.distance, 1), np.isfinite(one.distance).sum(1)
    means: Float64[Array, " d"] = (weights @ sums) / np.maximum(weights @ counts, 1.0)
    return means
