from dataclasses import replace

import numpy as np
import pytest
import torch

from model.predictor import rollout
from model.predictor.batches import Example, make_batch, true_values
from model.predictor.losses import track_loss
from model.predictor.objective import judge_motion, motion_terms
from model.predictor.prior_mean import PriorMeanPredictor
from model.predictor.rollout import mechanics_of, roll_out
from model.predictor.sample import GLOBALS, Prediction
from model.scenes.replay import replay


@pytest.fixture
def dropped(make_case):
    """A bar that is lifted at one end a little above the ground, on which it falls."""
    case = make_case(frames=14, modulus=(3e3, 1e4))
    raised = replace(
        case.topology,
        points=case.topology.points + np.float32([0.0, 0.0, 0.02]),
        controller_points=case.topology.controller_points + np.float32([0.0, 0.0, 0.02]),
    )
    seen = replace(
        case.observation,
        points=case.observation.points + np.float32([0.0, 0.0, 0.02]),
        controllers=case.observation.controllers + np.float32([0.0, 0.0, 0.02]),
    )
    return replace(case, topology=raised, observation=seen, complete=None, split=14)


def prediction_of(sample, seed=0):
    """Every output a leaf of its own, near the prior."""
    generator = torch.Generator().manual_seed(seed)

    def leaf(values):
        return (values + 0.3 * torch.randn(values.shape, generator=generator)).requires_grad_()

    ends = sample.prior_log_modulus[sample.edge_part].mean(1)
    return Prediction(
        log_modulus=leaf(ends),
        log_modulus_spread=torch.ones_like(ends),
        part_log_modulus=sample.prior_log_modulus,
        part_log_spread=sample.prior_log_spread,
        log_controller_stiffness=leaf(sample.log_grip_anchor),
        global_mean=leaf(sample.global_anchor),
        global_log_spread=sample.global_spread,
    )


def test_a_rollout_of_what_some_parameters_mean_is_their_replay(make_case, sample_of):
    case = make_case()
    sample, seen = sample_of(case), case.observation
    parameters = PriorMeanPredictor().from_priors(
        case.topology, case.priors, case.shape_class, seen.gravity, seen.ground_height
    )
    values = [float(parameters.globals[name].value) for name in GLOBALS]
    bounce = values.pop()
    means = Prediction(
        log_modulus=torch.as_tensor(parameters.stiffness).log() - sample.log_unit_stiffness,
        log_modulus_spread=torch.ones(len(sample.edges)),
        part_log_modulus=sample.prior_log_modulus,
        part_log_spread=sample.prior_log_spread,
        log_controller_stiffness=torch.as_tensor(parameters.controller_stiffness).log(),
        global_mean=torch.tensor([[*np.log(values), np.log(bounce / (1.0 - bounce))]], dtype=torch.float32),
        global_log_spread=sample.global_spread,
    )
    (mechanics,) = mechanics_of(means, sample, [case])
    np.testing.assert_allclose(roll_out(case, mechanics).numpy(), replay(case, parameters), atol=2e-5)


def test_gradients_reach_every_output_through_contact_with_the_ground(dropped, sample_of):
    sample = sample_of(dropped)
    prediction = prediction_of(sample)
    (mechanics,) = mechanics_of(prediction, sample, [dropped])
    moved = roll_out(dropped, mechanics)
    assert float(moved.detach()[..., 2].min()) < 2e-3  # it does touch the ground
    loss = track_loss(moved[1:], torch.as_tensor(dropped.observation.points[1:]), 0.01)
    loss.backward()
    springs = prediction.log_modulus.grad
    assert bool(torch.isfinite(springs).all())
    inner = sample.edge_part[:, 0] == sample.edge_part[:, 1]
    for part in range(2):
        own = springs[inner & (sample.edge_part[:, 0] == part)]
        assert float(own.norm()) > 1e-6
        assert float((own != 0).float().mean()) > 0.9
    grips = prediction.log_controller_stiffness.grad
    assert bool(torch.isfinite(grips).all())
    assert float(grips.norm()) > 1e-6
    values = prediction.global_mean.grad[0]
    for name, value in zip(GLOBALS, values, strict=True):
        assert np.isfinite(float(value)), name
        assert abs(float(value)) > 1e-7, name


def test_gradients_say_where_the_loss_goes(dropped, sample_of, monkeypatch):
    """Against differences, for the outputs whose gradients converge at these substeps."""
    monkeypatch.setattr(rollout, "STEEPEST", 1e9)
    free = replace(dropped, observation=replace(dropped.observation, ground_height=None))
    sample = sample_of(free)

    def loss(prediction):
        (mechanics,) = mechanics_of(prediction, sample, [free])
        return track_loss(roll_out(free, mechanics, 8), torch.as_tensor(free.observation.points[:8]), 0.01)

    prediction = prediction_of(sample)
    loss(prediction).backward()
    step = 0.02
    for name in ("log_modulus", "log_controller_stiffness"):
        value = getattr(prediction, name)
        with torch.no_grad():
            up, down = (loss(replace(prediction, **{name: value + sign * step})) for sign in (1, -1))
        measured = float(up - down) / (2 * step)
        assert float(value.grad.sum()) == pytest.approx(measured, rel=0.05, abs=2e-4), name
    for column in (0, 1):
        shift = torch.zeros(1, 4)
        shift[0, column] = step
        with torch.no_grad():
            up, down = (
                loss(replace(prediction, global_mean=prediction.global_mean + sign * shift))
                for sign in (1, -1)
            )
        measured = float(up - down) / (2 * step)
        assert float(prediction.global_mean.grad[0, column]) == pytest.approx(measured, rel=0.05, abs=2e-4)


def test_one_steep_case_does_not_drown_the_others_of_its_batch(dropped, make_case, sample_of, monkeypatch):
    calm = make_case(seed=1, frames=6)
    examples = [Example(case, sample_of(case), true_values(case, 2)) for case in (dropped, calm)]
    batch = make_batch(examples)
    prediction = prediction_of(batch.sample)
    monkeypatch.setattr(rollout, "STEEPEST", 1e-3)
    terms, diverged = motion_terms(prediction, batch, [0, 1], horizon=6)
    assert diverged == 0
    terms["track"].backward()
    springs = len(dropped.topology.springs)
    for own in (slice(0, springs), slice(springs, None)):
        norm = float(prediction.log_modulus.grad[own].norm())
        assert 0.0 < norm <= 1e-3 * (1 + 1e-4)


def test_a_case_that_diverges_is_left_out_and_counted(make_case, sample_of, monkeypatch):
    from model.predictor import objective
    from model.simulator.divergence import SimulationDiverged

    cases = [make_case(seed=seed, frames=6) for seed in (0, 1)]
    batch = make_batch([Example(case, sample_of(case), true_values(case, 2)) for case in cases])
    prediction, rolled = prediction_of(batch.sample), objective.roll_out

    def fragile(case, mechanics, frames=None, *, checkpoint=True):
        if case is cases[0]:
            raise SimulationDiverged(1, 0, "spring", 10)
        return rolled(case, mechanics, frames, checkpoint=checkpoint)

    monkeypatch.setattr(objective, "roll_out", fragile)
    alone, _ = motion_terms(prediction, batch, [1], horizon=4)
    both, diverged = motion_terms(prediction, batch, [0, 1], horizon=4)
    assert diverged == 1
    assert float(both["track"].detach()) == float(alone["track"].detach())
    none, diverged = motion_terms(prediction, batch, [0], horizon=4)
    assert (none, diverged) == ({}, 1)
    each = mechanics_of(prediction, batch.sample, cases)
    judged = judge_motion(cases[1], each[1])
    assert not judged.diverged
    assert judged.past > 0.0
    assert judged.future > 0.0


def test_a_held_out_case_that_diverges_counts_as_one_that_does_not_move(make_case, sample_of, monkeypatch):
    from model.predictor import objective
    from model.simulator.divergence import SimulationDiverged

    def wild(case, mechanics, frames=None, *, checkpoint=True):
        raise SimulationDiverged(1, 0, "spring", 10)

    def still(case, mechanics, frames=None, *, checkpoint=True):
        return torch.as_tensor(case.rest)[None].repeat(len(case.observation.times), 1, 1)

    case = make_case(frames=6)
    batch = make_batch([Example(case, sample_of(case), true_values(case, 2))])
    mechanics = mechanics_of(prediction_of(batch.sample), batch.sample, [case])[0]
    found = []
    for rolled in (wild, still):
        monkeypatch.setattr(objective, "roll_out", rolled)
        found.append(judge_motion(case, mechanics))
    assert [judged.diverged for judged in found] == [True, False]
    assert replace(found[0], diverged=False) == found[1]
    assert found[0].track > 0.0


def test_frames_from_the_split_on_are_never_trained_on(make_case, sample_of):
    case = make_case(frames=10)
    spoilt = case.observation.points.copy()
    spoilt[case.split :] = 1e3
    other = replace(case, observation=replace(case.observation, points=spoilt))
    found = []
    for one in (case, other):
        batch = make_batch([Example(one, sample_of(one), true_values(one, 2))])
        terms, _ = motion_terms(prediction_of(batch.sample), batch, [0], horizon=100)
        found.append([float(terms[name].detach()) for name in ("track", "chamfer")])
    assert found[0] == found[1]
