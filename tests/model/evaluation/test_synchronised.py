from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch

from model.errors import InputError
from model.evaluation.baselines import (
    Fitted,
    HoldLast,
    Method,
    NearestAnchors,
    PiecewiseField,
    PriorMean,
    TwoStage,
)
from model.evaluation.baselines.base import SpringMass
from model.evaluation.hidden import seen_until_split, unseen
from model.evaluation.protocol import Task, judge
from model.evaluation.synchronised import Lead, Synchronised
from model.scenes.replay import observed, roll
from model.simulator.divergence import SimulationDiverged
from model.simulator.system import State

PUSH = torch.tensor([1.5, 0.0, 1.0])


def pushed(case, frame=6):
    """The case as it goes with the prior's means, but hit by something that no twin knows of."""

    def hit(now, state):
        if now != frame:
            return state
        return State(state.positions, state.velocities + PUSH, state.memory)

    with torch.no_grad():
        points = roll(case, PriorMean().fit(case).simulator(case), lead=hit)
        complete = observed(case.anchors, points).numpy()
    return replace(case, observation=replace(case.observation, points=complete.copy()), complete=complete)


@pytest.fixture(scope="module")
def hit(make_case):
    return pushed(make_case(frames=18))


def far(case, made):
    """Mean distance from the truth in every frame [m]."""
    return np.linalg.norm(made - case.complete, axis=2).mean(axis=1)


def test_a_twin_that_knows_all_but_a_push_is_brought_to_the_truth(hit):
    shown = seen_until_split(hit)
    free = far(hit, PriorMean().fit(shown).predict(shown))
    led = far(hit, Synchronised(PriorMean()).fit(shown).predict(shown))
    assert free[hit.split] > 0.1
    assert led[hit.split] < 0.35 * free[hit.split]
    assert led[hit.split :].mean() < 0.35 * free[hit.split :].mean()
    # what was seen is simulated as the twin says
    np.testing.assert_array_equal(led[: hit.split], free[: hit.split])


def test_nothing_from_the_split_on_is_read(hit):
    shown = seen_until_split(hit)
    expected = Synchronised(PriorMean()).fit(shown).predict(shown)
    points = hit.observation.points.copy()
    points[hit.split :] += np.random.default_rng(0).normal(0.0, 1.0, points[hit.split :].shape)
    full = replace(hit, observation=replace(hit.observation, points=points.astype(np.float32)))
    np.testing.assert_array_equal(Synchronised(PriorMean()).fit(full).predict(full), expected)
    assert np.isfinite(expected).all()


def test_another_interaction_is_as_the_method_says(hit, make_case):
    shown = seen_until_split(hit)
    other = unseen(make_case(frames=12, lift=0.1, name="other"), shown.priors)
    led, free = Synchronised(PriorMean()).fit(shown), PriorMean().fit(shown)
    np.testing.assert_array_equal(led.predict(other), free.predict(other))
    np.testing.assert_array_equal(led.parameters.stiffness, free.parameters.stiffness)
    assert led.part_belief is not None
    np.testing.assert_array_equal(led.part_belief.log_modulus, free.part_belief.log_modulus)


def test_where_nothing_is_seen_nothing_leads(hit):
    shown = seen_until_split(hit)
    shown.observation.points[1:] = np.nan
    led, free = (method.fit(shown).predict(shown) for method in (Synchronised(PriorMean()), PriorMean()))
    np.testing.assert_allclose(led, free, atol=1e-6)


def test_a_velocity_is_found(make_case):
    """Points that drift steadily, and a twin that believes they stay where they were, at that speed."""
    case = make_case(frames=60)
    velocity = np.array([0.3, -0.1, 0.2])
    times = case.observation.times
    points = (case.rest + times[:, None, None] * velocity).astype(np.float32)
    case = replace(case, observation=replace(case.observation, points=points), split=59)
    lead, start = Lead(case), torch.as_tensor(case.topology.points)
    state = State(start, torch.zeros_like(start))
    for frame in range(1, 59):
        drifted = state.positions + (times[frame] - times[frame - 1]) * state.velocities
        state = lead(frame, State(drifted, state.velocities))
    near = state.velocities.numpy().mean(axis=0)
    np.testing.assert_allclose(near, velocity, rtol=0.03)
    np.testing.assert_allclose(lead.left, 0.0, atol=1e-3)


def test_what_leading_leaves_is_kept(make_case):
    """A twin whose springs always win: the object is elsewhere, and so is the prediction."""
    case = make_case(frames=30)
    points = np.repeat(case.rest[None] + np.float32([0.02, 0.0, 0.0]), 30, axis=0)
    case = replace(case, observation=replace(case.observation, points=points), split=29)
    lead, start = Lead(case), torch.as_tensor(case.topology.points)
    for frame in range(1, 29):
        state = lead(frame, State(start, torch.zeros_like(start)))
    places = observed(case.anchors, state.positions[None])[0].numpy() + lead.left
    np.testing.assert_allclose((places - case.rest).mean(axis=0), [0.02, 0.0, 0.0], atol=1e-3)
    assert lead.left[:, 0].mean() > 0.01
    after = lead(29, State(start, torch.zeros_like(start)))
    assert torch.equal(after.positions, start)


@pytest.mark.parametrize(
    "method",
    [
        PriorMean(),
        TwoStage(generations=0, steps=0),
        PiecewiseField(generations=0, steps=0),
        NearestAnchors(neighbours=12, starts=1, steps=0),
    ],
    ids=lambda method: method.name,
)
def test_what_is_led_is_what_predicts(method, hit, make_case):
    shown = seen_until_split(hit)
    fitted = method.fit(shown)
    for case in (shown, unseen(make_case(frames=8, lift=0.1, name="other"), shown.priors)):
        with torch.no_grad():
            rolled = observed(case.anchors, roll(case, fitted.simulator(case))).numpy()
        np.testing.assert_allclose(rolled, fitted.predict(case), atol=1e-6)


def test_only_springs_and_masses_are_led(hit):
    with pytest.raises(InputError, match="hold-last: no springs and masses to lead"):
        Synchronised(HoldLast()).fit(seen_until_split(hit))


def test_it_is_another_method_than_the_one_it_leads():
    assert Synchronised(PriorMean()).identity() != PriorMean().identity()
    assert Synchronised(PriorMean()).identity() != Synchronised(TwoStage()).identity()


@dataclass(frozen=True)
class Bursting:
    """Predicts, but bursts when led."""

    inner: Fitted
    parameters: None = None
    part_belief: None = None

    def predict(self, case):
        return self.inner.predict(case)

    def simulator(self, case):
        raise SimulationDiverged(1, 0, "spring", 1)


class Burst(Method):
    name = "burst"

    def fit(self, case):
        return Bursting(PriorMean().fit(case))


def test_a_twin_that_diverges_when_led_is_scored_as_if_nothing_moved_any_more(hit):
    shown = seen_until_split(hit)
    assert isinstance(Burst().fit(shown), SpringMass)
    task = Task(key="k", name="burst", method=Synchronised(Burst()), case=hit, own=hit)
    record, still = judge(task), judge(replace(task, method=HoldLast()))
    assert record.failed is not None
    assert "SimulationDiverged" in record.failed
    assert record.future == still.future
