from dataclasses import replace

import numpy as np
import pytest
import torch

from model.encoders import KinematicEncoder
from model.encoders.motion import EncodedMotion, MotionClip, MotionEncoder
from model.errors import InputError
from model.predictor import ALL_PREDICTORS, PriorMeanPredictor, TrainedPredictor
from model.predictor.checkpoint import About, save_predictor
from model.predictor.options import NetworkOptions
from model.scenes.priors import with_priors


def _about(options: NetworkOptions, encoder: KinematicEncoder, **changed: str) -> About:
    told = {"encoder": encoder.name, "encoder_version": encoder.version, **changed}
    return About(
        schema="matphys.predictor/1",
        options=options.as_dict(),
        motion_dim=encoder.dim,
        motion_global_dim=encoder.global_dim,
        **told,
    )


@pytest.fixture(scope="module")
def untrained(tmp_path_factory):
    torch.manual_seed(0)
    encoder, options = KinematicEncoder(), NetworkOptions(dim=16, layers=1, heads=2)
    path = tmp_path_factory.mktemp("predictor") / "untrained.safetensors"
    save_predictor(path, options.build(encoder.dim, encoder.global_dim), _about(options, encoder))
    return path


def test_an_untrained_network_says_what_the_prior_says(untrained, make_case):
    case = make_case()
    parameters, expected = TrainedPredictor(untrained)(case), PriorMeanPredictor()(case)
    np.testing.assert_allclose(parameters.stiffness, expected.stiffness, rtol=0.1)
    assert {parameters.globals[name].source for name in ("dashpot_damping", "friction")} == {"predicted"}
    assert all(parameters.globals[name].std > 0.0 for name in ("dashpot_damping", "drag_rate"))


def test_another_encoder_than_in_training_is_refused(tmp_path):
    encoder, options = KinematicEncoder(), NetworkOptions(dim=16, layers=1, heads=2)
    network = options.build(encoder.dim, encoder.global_dim)
    save_predictor(tmp_path / "old.safetensors", network, _about(options, encoder, encoder_version="0"))
    with pytest.raises(InputError, match="trained with motion encoder kinematic 0, but given kinematic"):
        TrainedPredictor(tmp_path / "old.safetensors")


def test_what_ships_is_the_default_and_makes_up_for_a_prior_that_knows_nothing(make_case):
    assert ALL_PREDICTORS[0] is TrainedPredictor
    ours = TrainedPredictor()
    errors = []
    for seed, modulus in enumerate([(2e3, 2e4), (3e4, 3e3)]):
        case = make_case(seed=seed, modulus=modulus, frames=24, noise=5e-4)
        told = with_priors(case, "uniform", np.random.default_rng(seed))
        blind = replace(told, truth=None, complete=None)
        found = ours.believe(blind)[1].part_log_modulus.numpy()
        prior = np.log([prior.properties["stiffness"].mean for prior in told.priors])
        errors.append([np.abs(found - np.log(modulus)).mean(), np.abs(prior - np.log(modulus)).mean()])
    mine, priors = np.mean(errors, axis=0)
    assert mine < 0.6 * priors


def test_the_future_and_the_truth_are_not_looked_at(make_case):
    case = make_case(frames=16)
    points = case.observation.points.copy()
    points[case.split :] += 1.0
    spoiled = replace(case, truth=None, complete=None, observation=replace(case.observation, points=points))
    ours = TrainedPredictor()
    np.testing.assert_array_equal(ours(case).stiffness, ours(spoiled).stiffness)


class _Still(MotionEncoder):
    """Compares with nothing."""

    name, version = "still", "1"
    dim, global_dim = 2, 1

    def forward(self, clip: MotionClip) -> EncodedMotion:
        widths = ((clip.rest.shape[0], 1), (clip.parts, 1), 1)
        return EncodedMotion(*(np.zeros(width, np.float32) for width in widths))


@pytest.fixture
def still(tmp_path):
    encoder, options = _Still(), NetworkOptions(dim=16, layers=1, heads=2)
    path = tmp_path / "still.safetensors"
    save_predictor(path, options.build(encoder.dim, encoder.global_dim), _about(options, encoder))
    return TrainedPredictor(path, encoder)


def test_motion_that_was_seen_and_not_compared_is_said(untrained, still, make_case, monkeypatch):
    case, ours = make_case(frames=16), TrainedPredictor(untrained)
    assert not any("was judged" in line for line in ours(case).warnings)
    springs = len(case.topology.springs)
    monkeypatch.setattr("model.predictor.reference.MOST_WORK", 7 * springs)
    assert ours(case).warnings[-1] == (
        f"stiffness was judged by the motion up to 0.2 s alone: {springs} springs are too many for more; "
        "fewer --points leave room for all of it"
    )
    assert not any("was judged" in line for line in ours(replace(case, split=7)).warnings)
    assert not any("was judged" in line for line in still(case).warnings)


def test_a_network_that_predicts_no_numbers_is_refused(untrained, make_case, tmp_path):
    """Weights are finite, what comes of them is not."""
    trained = TrainedPredictor(untrained).trained
    with torch.no_grad():
        for value in trained.network.parameters():
            value.mul_(1e20)
    save_predictor(tmp_path / "wild.safetensors", trained.network, trained.about)
    with pytest.raises(InputError, match=r"for log_modulus.* is not finite: the network's training"):
        TrainedPredictor(tmp_path / "wild.safetensors")(make_case(frames=8))
