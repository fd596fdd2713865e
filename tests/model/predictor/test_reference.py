"""Twins of reference: what they are, and that they can always be afforded."""

from dataclasses import replace

import numpy as np
import pytest

from model.predictor.affordable import SUBSTEPS
from model.predictor.prior_mean import PriorMeanPredictor
from model.predictor.reference import (
    DAMPING_RATIO,
    DRAG_RATE,
    FRICTION,
    RESTITUTION,
    STEP,
    compared_frames,
    reference_motion,
)
from model.scenes.replay import replay
from model.simulator.simulator import Simulator
from model.types import Estimate


def references(case):
    return reference_motion(case.topology, case.shape_class, case.anchors, case.observation, case.camera)


@pytest.fixture(scope="module")
def case(make_case):
    return make_case(seed=3, modulus=(5e3, 5e3), frames=10)


@pytest.fixture(scope="module")
def found(case):
    return references(case)


def middling(case, log_modulus, **changes):
    """What `PriorMeanPredictor` makes of priors that are sure of the reference's constants."""
    means = {"stiffness": 150.0 * np.exp(log_modulus), "density": 150.0, "damping": DAMPING_RATIO}
    means |= {"drag_rate": DRAG_RATE, "friction": FRICTION, "restitution": RESTITUTION, **changes}
    properties = {name: Estimate(float(value), 0.1, "") for name, value in means.items()}
    priors = [replace(prior, properties=properties) for prior in case.priors]
    return PriorMeanPredictor().from_priors(case.topology, priors, "solid", case.observation.gravity, 0.0)


def test_sweep_is_what_the_prior_means_of_such_bodies_do(case, found):
    for place in (0, 2):
        log_modulus = found.sweep_log_modulus[place]
        np.testing.assert_allclose(found.sweep[place], replay(case, middling(case, log_modulus)), atol=2e-4)


def test_base_lies_where_the_truth_does(found):
    assert found.base_log_modulus == pytest.approx([np.log(5e3 / 150.0)] * 2, abs=0.45)


def test_one_constant_is_changed_at_a_time(case, found, monkeypatch):
    assert found.varied.shape == (6, *case.observation.points.shape)
    np.testing.assert_array_equal(np.abs(found.steps), STEP)
    far = np.abs(found.varied - found.base).max(axis=(1, 2, 3))
    assert (far[[0, 1, 3]] > 1e-3).all()
    # the first base is uniform, so one round shows a change that the prior's means can express
    monkeypatch.setattr("model.predictor.reference.ROUNDS", 1)
    once = references(case)
    assert once.base_log_modulus[0] == once.base_log_modulus[1]
    drag = replay(case, middling(case, once.base_log_modulus[0], drag_rate=DRAG_RATE * np.exp(STEP)))
    np.testing.assert_allclose(once.varied[3], drag, atol=2e-4)


def test_without_ground_friction_and_restitution_do_not_act(case):
    floating = replace(case, observation=replace(case.observation, ground_height=None))
    found = references(floating)
    np.testing.assert_array_equal(found.steps[-2:], 0.0)
    np.testing.assert_array_equal(found.varied[-2:], np.stack([found.base, found.base]))


def test_no_twin_takes_more_substeps_than_a_twin_may(case, monkeypatch):
    """A body of short springs, in which sound would take hundreds of substeps."""
    taken = []
    rollout = Simulator.rollout

    def counting(self, *args, **kwargs):
        made = rollout(self, *args, **kwargs)
        taken.extend(made.substeps)
        return made

    monkeypatch.setattr(Simulator, "rollout", counting)
    small, scale = case.topology, np.float32(0.1)
    tiny = replace(
        small,
        points=small.points * scale,
        rest_length=small.rest_length * scale,
        mass=small.mass * scale**3,
        controller_points=small.controller_points * scale,
        controller_rest_length=small.controller_rest_length * scale,
    )
    seen = replace(
        case.observation,
        points=case.observation.points * scale,
        controllers=case.observation.controllers * scale,
    )
    found = reference_motion(tiny, "solid", case.anchors, seen, None)
    assert found.sweep_log_modulus[-1] < np.log(3000.0)
    assert found.sweep_log_modulus[-1] == found.sweep_log_modulus[-2] or len(set(taken)) > 1
    assert max(taken) <= 1.1 * SUBSTEPS


def test_long_clips_of_large_twins_are_compared_in_their_first_frames():
    assert compared_frames(15_000, 200) == 60
    assert compared_frames(500, 200) == 200
