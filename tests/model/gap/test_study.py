"""The plain twin of a study: what it is fitted to, where fits begin, that they end well."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.erring_hand import HAND, HOLD
from model.gap.estimate import FIRST_HORIZON, estimate
from model.gap.misfit import Span
from model.gap.study import COSTLIEST, FOLLOWED, SPREAD, STARTS, STEPS, best_fit, starts_of, study

# a fit takes the substeps of its first worlds for all; `diagnose` is silent about it as well
pytestmark = pytest.mark.filterwarnings("ignore::model.simulator.pace.StabilityWarning")


@pytest.fixture(scope="module")
def rope(short, studied):
    """A rope that swings, four times softer than it is taken for; two points are lost for a while."""
    observation = studied(short, softer=0.25, noise=5e-4).observation
    points = observation.points.copy()
    points[5:9, 2:4] = np.nan
    return replace(observation, points=points)


@pytest.fixture(scope="module")
def found(rope):
    return study(rope)


def test_the_end_is_held_out(found, rope):
    assert found.split == round(0.7 * len(rope.times))
    assert (found.misfit.span.first, found.misfit.span.last) == (0, found.split - 1)
    assert found.start == {name: q.start for name, q in found.plain.quantities.items()}


def test_residuals_are_of_points_that_were_seen(found, rope):
    seen = np.isfinite(rope.points[: found.split, :, 0])
    seen[0] = False
    np.testing.assert_array_equal(found.seen, seen)
    frames = found.frame_of_residuals()
    assert frames.shape == found.base.residuals.shape == (3 * seen.sum(),)
    np.testing.assert_array_equal(np.bincount(frames, minlength=found.split), 3 * seen.sum(1))
    field = found.residuals(found.base)
    assert field.shape == (found.split, rope.points.shape[1], 3)
    assert not field[~seen].any()
    np.testing.assert_array_equal(field[seen].ravel(), found.base.residuals)


def test_it_is_dear_where_there_are_many_springs_frames_and_substeps(found, monkeypatch):
    assert not found.dear
    body, substeps = found.plain.twin.body, found.misfit.needs(found.base.vector)
    work = len(body.springs) * substeps * len(found.observation.times)
    for limit in (work - 1, work + 1):
        monkeypatch.setattr("model.gap.study.DEAR", limit)
        assert found.dear == (limit < work)


def test_fits_begin_with_what_the_twin_came_with_and_all_around_it(found):
    starts = starts_of(found.misfit, found.start)
    coordinates = found.misfit.coordinates
    low, high = coordinates.bounds
    assert starts.shape == (STARTS + 1, len(coordinates.names))
    np.testing.assert_array_equal(starts[0], coordinates.vector(found.start))
    assert (starts >= low).all()
    assert (starts <= high).all()
    assert len(np.unique(starts, axis=0)) == len(starts)
    stiffness = coordinates.names.index("stiffness")
    away = starts[:, stiffness] - starts[0, stiffness]
    assert -SPREAD["stiffness"] <= away.min() < -0.8 * SPREAD["stiffness"]
    assert 0.8 * SPREAD["stiffness"] < away.max() <= SPREAD["stiffness"]


def test_a_hand_reaches_more_or_less_far_in_them(found):
    starts = starts_of(found.misfit, found.start)
    reach = starts[:, found.misfit.coordinates.names.index("reach")]
    assert reach.max() - reach.min() > 1.2 * SPREAD["reach"]


def test_a_twin_that_comes_with_extreme_values_has_starts_within_its_bounds(found):
    edge = {name: quantity.bounds[1] for name, quantity in found.plain.quantities.items()}
    starts = starts_of(found.misfit, edge)
    low, high = found.misfit.coordinates.bounds
    assert (starts >= low).all()
    assert (starts <= high).all()


def test_a_sheets_gradient_begins_even_and_its_hands_where_they_were_measured(hung, studied):
    misfit = studied(hung).misfit
    start = {name: quantity.start for name, quantity in misfit.coordinates.quantities.items()}
    starts = starts_of(misfit, start)
    columns = [
        i for i, name in enumerate(misfit.coordinates.names) if name.startswith(("gradient", HAND, HOLD))
    ]
    assert len(columns) > 2
    assert not starts[:, columns].any()


def test_the_fit_is_at_least_as_good_as_from_the_start_alone(found):
    misfit = found.misfit.of(found.plain)
    first = misfit.coordinates.vector(found.start)
    quarter = max(FIRST_HORIZON, found.split // 4)
    alone = estimate(misfit, first[None], STEPS, quarter)
    untouched = float((misfit(first[None]) ** 2).mean())
    assert found.base.cost < 0.5 * untouched
    negligible = 0.01  # of the noise
    assert found.base.cost <= 1.02 * alone.cost + negligible


def test_one_start_more_cannot_harm(found, monkeypatch):
    """The better of two is taken: with one that is followed the fit is no better."""
    monkeypatch.setattr("model.gap.study.STARTS", 5)
    monkeypatch.setitem(FOLLOWED, found.plain.twin.body.shape, 1)
    one = best_fit(found.misfit.of(found.plain).until(6), found.start)
    monkeypatch.setitem(FOLLOWED, found.plain.twin.body.shape, 2)
    two = best_fit(found.misfit.of(found.plain).until(6), found.start)
    assert two.cost <= one.cost
    assert found.misfit.span == Span(0, found.split - 1)


def test_where_rollouts_take_long_fits_give_up_worlds_that_take_longer_still(found, monkeypatch):
    assert found.in_time(found.misfit) is found.misfit
    monkeypatch.setattr("model.gap.study.DEAR", 0.0)
    bounded = found.in_time(found.misfit)
    assert bounded.most == round(COSTLIEST * found.misfit.needs(found.base.vector))
    near = bounded(found.base.vector[None])[0]
    np.testing.assert_allclose(near, found.base.residuals, atol=1e-3)
    stiff = found.base.values | {"stiffness": 1e3 * found.base.values["stiffness"]}
    far = bounded.coordinates.vector(stiff)
    assert bounded.needs(far) > bounded.most
    assert (bounded(far[None]) == found.observer.lost / found.misfit.noise).all()
