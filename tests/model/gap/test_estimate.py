"""A fit finds what was planted, through an observer."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from model.gap.belief import Belief
from model.gap.bodies.body import body_of
from model.gap.coordinates import Coordinates
from model.gap.effects.base import Quantity
from model.gap.erring_hand import ERRING, HAND, HOLD
from model.gap.estimate import descended, estimate
from model.gap.hypothesis import Hypothesis
from model.gap.misfit import STEADY, WIDEST, Misfit, Span
from model.gap.noise import noise_of
from model.gap.observer import Observer
from model.gap.plain import EVEN, PlainTwin
from model.types import Observation

FRAMES = 40


@pytest.fixture
def shaken():
    """A sheet held by one edge and shaken, as an observation that has not moved yet, and its twin."""
    u, v = np.meshgrid(np.linspace(0, 0.3, 9), np.linspace(0, 0.2, 7), indexing="ij")
    places = np.stack([u, 0 * u, -v], -1).reshape(-1, 3)
    times = np.arange(FRAMES) / 30.0
    held = places[places[:, 2] > -0.01]
    swing = np.stack([0.05 * np.sin(9 * times), 0.08 * np.sin(7 * times), 0 * times], -1)
    still = Observation(
        times=times,
        points=np.repeat(places[None].astype(np.float32), FRAMES, 0),
        controllers=(held[None] + swing[:, None]).astype(np.float32),
    )
    return still, PlainTwin.of(body_of(still, "sheet"), still)


def moved(still, hypothesis, values, noise=5e-4):
    with torch.no_grad():
        world = hypothesis.at(values)
        points = world.sight(world.rollout().points).numpy()
    points = points + np.random.default_rng(1).normal(0, noise, points.shape)
    return replace(still, points=points.astype(np.float32))


@pytest.fixture
def followed(shaken):
    """A function: misfit and start of a plain twin that follows one of which some values are multiplied."""
    still, twin = shaken
    plain = Hypothesis(twin)
    start = {name: quantity.start for name, quantity in plain.quantities.items()}

    def of(**times):
        seen = moved(still, plain, {**start, **{name: by * start[name] for name, by in times.items()}})
        return Misfit(plain, Observer(seen, plain.at(start), 0.3), Span(0, FRAMES - 1), 5e-4), start

    return of


def test_noise_is_told_from_motion(shaken):
    still, _ = shaken
    carried = still.points + 0.1 * np.sin(8 * still.times)[:, None, None]
    noise = np.random.default_rng(1).normal(0, 2e-3, carried.shape)
    seen = replace(still, points=(carried + noise).astype(np.float32))
    assert noise_of(seen) == pytest.approx(2e-3, rel=0.05)


def test_noise_is_the_same_whichever_way_the_world_is_turned(shaken):
    still, _ = shaken
    flat = np.random.default_rng(1).normal(0, 1, still.points.shape) * np.array([3e-3, 1e-3, 0.0])
    turn = Rotation.from_euler("zx", (40, 25), degrees=True).as_matrix()
    one, other = (
        replace(still, points=((still.points + flat) @ by.T).astype(np.float32)) for by in (np.eye(3), turn)
    )
    assert noise_of(other) == pytest.approx(noise_of(one), rel=1e-4)


def test_finds_what_was_planted(shaken):
    still, twin = shaken
    plain = Hypothesis(twin)
    start = {name: quantity.start for name, quantity in plain.quantities.items()}
    truth = {**start, "stiffness": 0.4 * start["stiffness"], "drag_rate": 1.5}
    seen = moved(still, plain, truth)
    assert 4e-4 < noise_of(seen) < 1.2e-3
    misfit = Misfit(plain, Observer(seen, plain.at(start), 0.3), Span(0, FRAMES - 1), 5e-4)
    vector = misfit.coordinates.vector(start)
    found = estimate(misfit, vector[None], steps=12)
    assert found.values["stiffness"] == pytest.approx(truth["stiffness"], rel=0.03)
    assert found.values["drag_rate"] == pytest.approx(truth["drag_rate"], rel=0.05)
    assert found.cost < 1.4 < 0.1 * float((misfit(vector[None]) ** 2).mean())


def test_what_is_seen_overrules_what_is_believed(shaken):
    """One end of the sheet is four times as stiff as the other: three standard deviations from even."""
    still, twin = shaken
    plain = Hypothesis(twin)
    start = {name: quantity.start for name, quantity in plain.quantities.items()}
    seen = moved(still, plain, {**start, "gradient_1": 3.0 * EVEN}, noise=2e-4)
    misfit = Misfit(plain, Observer(seen, plain.at(start), 0.3), Span(0, FRAMES - 1), 3e-4)
    found = estimate(misfit, misfit.coordinates.vector(start)[None], steps=12)
    assert found.values["gradient_1"] == pytest.approx(3.0 * EVEN, rel=0.25)


def test_what_is_hardly_seen_stays_where_it_is_believed_to_be(shaken):
    """Seen too coarsely to tell, and begun far off."""
    still, twin = shaken
    plain = Hypothesis(twin)
    start = {name: quantity.start for name, quantity in plain.quantities.items()}
    seen = moved(still, plain, start, noise=0.02)
    misfit = Misfit(plain, Observer(seen, plain.at(start), 0.3), Span(0, FRAMES - 1), 0.02)
    begun = misfit.coordinates.vector({**start, "gradient_1": 1.2, "hand_1_z": 0.008})
    found = estimate(misfit, begun[None], steps=12)
    assert abs(found.values["gradient_1"]) < EVEN
    assert abs(found.values["hand_1_z"]) < ERRING


class Overshooting(Misfit):
    """Residuals whose full Gauss-Newton step leads farther away than where it began."""

    def __init__(self):
        self.span = Span(0, 4)
        self.coordinates = Coordinates({"x": Quantity("1", (np.exp(-20.0), np.exp(20.0)), 1.0, log=True)})
        self.evaluations = self.slopes = 0

    def __call__(self, vectors):
        self.evaluations += len(vectors)
        return np.arctan(4.0 * (vectors - 8.0)) * np.ones(50)

    def jacobian(self, vector, width=0.02):
        self.slopes += 1
        return 4.0 * np.ones((50, 1)) / (1.0 + 16.0 * (vector - 8.0) ** 2)

    def renewed(self, vector, slopes):
        return slopes

    def belief(self, residuals, around):
        return Belief.loose(around)

    def until(self, last):
        return self


@pytest.mark.parametrize("steps", [1, 2, 3])
def test_a_step_that_leads_uphill_is_tried_shorter(steps):
    """It costs one rollout, not the step: as many slopes are asked for as there are steps, and no more."""
    misfit = Overshooting()
    found = estimate(misfit, np.array([[10.0]]), steps)
    assert misfit.slopes == steps
    assert np.sqrt(found.cost) < [1.45, 1.2, 0.7][steps - 1]


def test_slopes_of_where_a_hand_is_are_kept_from_step_to_step(followed):
    """Some steps, and until they are asked for where a fit ends; all others are looked at anew each time."""
    misfit, start = followed(stiffness=0.4)
    hands = np.array([name.startswith((HAND, HOLD)) for name in misfit.coordinates.names])
    assert hands.sum() == 6
    here, there = (
        misfit.coordinates.vector({**start, "stiffness": by * start["stiffness"]}) for by in (1, 0.3)
    )
    first = misfit.jacobian(here)
    spent = misfit.evaluations
    np.testing.assert_array_equal(misfit.renewed(here, first), first)
    second = misfit.jacobian(there)
    # the unmoved world rolls out beside each portion of the others
    assert spent == len(hands) + np.ceil(len(hands) / (WIDEST - 1))
    assert misfit.evaluations - spent == (~hands).sum() + np.ceil((~hands).sum() / (WIDEST - 1))
    np.testing.assert_array_equal(second[:, hands], first[:, hands])
    every = misfit.of(misfit.hypothesis).jacobian(there)
    alike = {"rtol": 0.0, "atol": 0.03}  # single precision, other worlds beside
    assert np.abs(every[:, hands] - first[:, hands]).max() > 0.3
    np.testing.assert_allclose(second[:, ~hands], every[:, ~hands], **alike)
    np.testing.assert_allclose(misfit.renewed(there, second), every, **alike)
    for _ in range(STEADY[HAND] - 1):
        last = misfit.jacobian(there)
    np.testing.assert_allclose(last, every, **alike)


def test_slopes_are_those_of_where_a_fit_ends(followed):
    misfit, start = followed(stiffness=0.4)
    found = estimate(misfit, misfit.coordinates.vector(start)[None], steps=3, shortest=FRAMES)
    hands = np.array([name.startswith(HAND) for name in misfit.coordinates.names])
    there = misfit.of(misfit.hypothesis).jacobian(found.vector)
    np.testing.assert_allclose(found.jacobian[:, hands], there[:, hands], rtol=0.0, atol=0.05)


@pytest.fixture
def soft_and_stiff(followed, monkeypatch):
    """A misfit, and coordinates of a world that needs few substeps and of one that needs many."""
    monkeypatch.setattr("model.simulator.pace.LONGEST", 1.0)  # stability alone asks for substeps
    misfit, start = followed()
    most = misfit.hypothesis.quantities["stiffness"].bounds[1]
    return misfit, *(misfit.coordinates.vector(values) for values in (start, {**start, "stiffness": most}))


def test_a_world_that_needs_too_many_substeps_is_lost_and_no_other(soft_and_stiff):
    misfit, soft, stiff = soft_and_stiff
    assert misfit.needs(stiff) > misfit.needs(soft)
    few = misfit.giving_up(misfit.needs(soft))
    rows = few(np.stack([soft, stiff]))
    np.testing.assert_allclose(rows[:1], few(soft[None]))
    assert (rows[1] == misfit.observer.lost / misfit.noise).all()


def test_a_world_that_diverges_is_lost_and_no_other_is_rolled_out_again(soft_and_stiff, monkeypatch):
    misfit, soft, stiff = soft_and_stiff
    enough = misfit.needs(soft)
    assert misfit.needs(stiff) > 2 * enough
    monkeypatch.setattr(Misfit, "_divided", lambda self, world: enough)
    runs, lead = [], Observer.lead
    monkeypatch.setattr(Observer, "lead", lambda *args, **more: runs.append(1) or lead(*args, **more))
    rows = misfit(np.stack([soft, stiff, soft]))
    assert len(runs) == 1
    np.testing.assert_allclose(rows[0], rows[2], rtol=0.0, atol=0.01)
    np.testing.assert_allclose(rows[:1], misfit(soft[None]), rtol=0.0, atol=0.01)
    assert (rows[1] == misfit.observer.lost / misfit.noise).all()
    assert (misfit(stiff[None]) == misfit.observer.lost / misfit.noise).all()


def test_short_horizons_lead_no_fit_away_from_where_it_began(followed, monkeypatch):
    """What they say may be wrong of all frames: then the whole horizon begins where the first one did."""
    misfit, start = followed(stiffness=3.0)
    true = misfit.coordinates.vector({**start, "stiffness": 3.0 * start["stiffness"]})
    whole, began = Misfit.__call__, []

    def misled(self, vectors):
        """The first frames want everything at its lower bounds."""
        left = whole(self, vectors)
        if self.span.last < misfit.span.last:
            return left + 10.0 * (vectors - misfit.coordinates.bounds[0]).sum(1, keepdims=True)
        return left

    def watched(part, vector, *others, **options):
        began.append((part.span.last, vector))
        return descended(part, vector, *others, **options)

    monkeypatch.setattr(Misfit, "__call__", misled)
    monkeypatch.setattr("model.gap.estimate.descended", watched)
    found = estimate(misfit, true[None], 2)
    (first, *between, (last, finally_)) = began
    np.testing.assert_array_equal(first[1], true)
    assert last == misfit.span.last
    assert max(np.abs(vector - true).max() for _, vector in between) > 0.5, "they led away"
    np.testing.assert_array_equal(finally_, true)
    assert found.cost <= float((whole(misfit, true[None]) ** 2).mean())
