import time
from dataclasses import fields, replace

import numpy as np
import pytest
import torch

from model.predictor.joining import join_samples, split_prediction
from model.predictor.motion_features import MotionFeatures
from model.predictor.network import PredictorNetwork
from model.predictor.parametrisation import to_parameters
from model.predictor.prior_mean import PriorMeanPredictor
from model.predictor.sample import GLOBALS, make_sample

OUTPUTS = (
    "log_modulus",
    "log_modulus_spread",
    "part_log_modulus",
    "part_log_spread",
    "log_controller_stiffness",
    "global_mean",
    "global_log_spread",
)


def network(seed=0, **switches):
    torch.manual_seed(seed)
    return PredictorNetwork(motion_dim=5, motion_global_dim=3, **switches)


def opinionated(seed=0, **switches):
    """A network whose heads are as loud as the rest, so that what reaches them shows."""
    made = network(seed, **switches)
    with torch.no_grad():
        for decoder in (made.part_decoder, made.edge_decoder, made.grip_decoder, made.global_decoder):
            decoder.head[-1].weight.mul_(1000.0)
    return made.double().eval()


@pytest.fixture(scope="module")
def case(make_case):
    return make_case(frames=3)


@pytest.fixture(scope="module")
def sample(case, sample_of):
    return sample_of(case)


def same(first, second, tolerance):
    for name in OUTPUTS:
        torch.testing.assert_close(
            getattr(first, name), getattr(second, name), rtol=tolerance, atol=tolerance
        )


def differs(first, second, name):
    return float((getattr(first, name) - getattr(second, name)).detach().abs().max())


def test_an_untrained_network_says_what_the_prior_means(case, sample):
    made = network().eval()
    prediction = made(sample)
    gravity = case.observation.gravity
    found = to_parameters(prediction, sample, case.topology, gravity, 0.0)
    expected = PriorMeanPredictor().from_priors(case.topology, case.priors, "solid", gravity, 0.0)
    np.testing.assert_allclose(found.stiffness, expected.stiffness, rtol=0.02)
    np.testing.assert_allclose(found.controller_stiffness, expected.controller_stiffness, rtol=0.02)
    assert set(found.globals) == set(expected.globals)
    for name in GLOBALS:
        assert found.globals[name].value == pytest.approx(expected.globals[name].value, rel=0.02)
        assert found.globals[name].std == pytest.approx(expected.globals[name].std, rel=0.02)
    prior = [p.properties["stiffness"] for p in case.priors]
    np.testing.assert_allclose(prediction.part_log_spread.detach(), [p.spread for p in prior], rtol=0.02)
    np.testing.assert_allclose(prediction.part_log_modulus.detach().exp(), [p.mean for p in prior], rtol=0.02)


def test_every_parameter_has_a_gradient_from_every_output_that_it_should_reach(case, sample_of):
    made = network(dropout=0.0).double()
    # two cases, so that no token is alone, and both parts have inner springs
    joined = join_samples([sample_of(case, 0), sample_of(case, 1)]).to(torch.float64)
    beyond = {
        "log_modulus": ("grip", "global"),
        "log_modulus_spread": ("grip", "global"),
        "part_log_modulus": ("grip", "global"),
        "part_log_spread": ("grip", "global", "edge_decoder", "geometry"),
        "log_controller_stiffness": ("global",),
        "global_mean": ("grip",),
        "global_log_spread": ("grip", "edge_decoder", "geometry", "part_decoder"),
    }
    for output in OUTPUTS:
        made.zero_grad()
        answer = getattr(made(joined), output)
        weight = torch.linspace(0.5, 1.5, answer.numel(), dtype=answer.dtype).reshape(answer.shape)
        (answer * weight).sum().backward()
        for name, parameter in made.named_parameters():
            if name.startswith(beyond[output]):
                continue
            assert parameter.grad is not None, (output, name)
            assert torch.isfinite(parameter.grad).all(), (output, name)
            if name.endswith("key.bias"):  # the same for all points of a part: attention cannot see it
                continue
            assert parameter.grad.abs().max() > 0.0, (output, name)


def test_all_outputs_together_reach_every_parameter_of_a_network_in_training(sample):
    made = network().train()
    prediction = made(sample)
    sum(getattr(prediction, name).square().sum() for name in OUTPUTS).backward()
    for name, parameter in made.named_parameters():
        assert parameter.grad is not None, name
        assert torch.isfinite(parameter.grad).all(), name


def held_end(case):
    """The part that is held, by itself."""
    topology = case.topology
    kept = topology.part == 0
    place = np.cumsum(kept) - 1
    inner = kept[topology.springs].all(axis=1)
    smaller = replace(
        topology,
        points=topology.points[kept],
        mass=topology.mass[kept],
        part=topology.part[kept],
        springs=place[topology.springs[inner]].astype(np.int32),
        rest_length=topology.rest_length[inner],
        controller_springs=np.stack(
            [topology.controller_springs[:, 0], place[topology.controller_springs[:, 1]]], axis=1
        ).astype(np.int32),
    )
    return replace(case, topology=smaller, priors=case.priors[:1])


def test_joined_cases_are_predicted_as_each_alone(make_case, sample_of):
    made = opinionated()
    cases = [make_case(seed, frames=3) for seed in (0, 3)]
    cases.append(held_end(cases[1]))
    samples = [sample_of(case, seed).to(torch.float64) for seed, case in enumerate(cases)]
    together = split_prediction(made(join_samples(samples)), samples)
    for prediction, each in zip(together, samples, strict=True):
        same(prediction, made(each), 1e-9)
    nested = join_samples([join_samples(samples[:2]), samples[2]])
    same(made(nested), made(join_samples(samples)), 1e-12)


def test_the_order_of_points_springs_and_parts_does_not_matter(case, sample_of):
    made = opinionated()
    rng = np.random.default_rng(5)
    topology, points = case.topology, len(case.topology.points)
    order, springs = rng.permutation(points), rng.permutation(len(topology.springs))
    place = np.argsort(order)  # old → new
    flip = rng.random(len(springs)) < 0.5
    pairs = place[topology.springs[springs]].astype(np.int32)
    pairs[flip] = pairs[flip][:, ::-1]
    grips = topology.controller_springs.copy()
    grips[:, 1] = place[grips[:, 1]]
    shuffled = replace(
        topology,
        points=topology.points[order],
        mass=topology.mass[order],
        springs=pairs,
        rest_length=topology.rest_length[springs],
        part=(1 - topology.part[order]).astype(np.int32),
        controller_springs=grips,
    )
    other = replace(case, topology=shuffled, priors=case.priors[::-1])
    before = sample_of(case)
    after = sample_of(other, points=before.motion.numpy()[order])
    first, second = made(before.to(torch.float64)), made(after.to(torch.float64))
    for name in ("log_modulus", "log_modulus_spread"):
        torch.testing.assert_close(getattr(second, name), getattr(first, name)[springs], rtol=1e-5, atol=1e-5)
    for name in ("part_log_modulus", "part_log_spread"):
        torch.testing.assert_close(getattr(second, name), getattr(first, name).flip(0), rtol=1e-5, atol=1e-5)
    for name in ("log_controller_stiffness", "global_mean", "global_log_spread"):
        torch.testing.assert_close(getattr(second, name), getattr(first, name), rtol=1e-5, atol=1e-5)


def test_where_the_object_is_and_which_way_it_faces_does_not_matter(case, sample_of):
    made = opinionated()
    turn = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])

    def moved(points):
        return (points.astype(np.float64) @ turn.T + [0.3, -0.2, 0.0]).astype(np.float32)

    topology = replace(
        case.topology,
        points=moved(case.topology.points),
        controller_points=moved(case.topology.controller_points),
    )
    before = made(sample_of(case).to(torch.float64))
    after = made(sample_of(replace(case, topology=topology)).to(torch.float64))
    same(before, after, 2e-4)  # places are float32: a shift of 0.3 m rounds them by 1e-8 m
    tipped = replace(case.topology, points=case.topology.points[:, [2, 1, 0]].copy())
    other = made(sample_of(replace(case, topology=tipped)).to(torch.float64))
    assert differs(before, other, "log_modulus") > 1e-2  # but which way is up does


@pytest.mark.parametrize(
    ("switch", "name"),
    [
        ("motion", "motion"),
        ("motion", "motion_global"),
        ("geometry", "edge_features"),
        ("codebook", "distribution"),
    ],
)
def test_an_ablation_does_not_see_what_the_full_network_sees(sample, switch, name):
    sample = sample.to(torch.float64)
    other = replace(
        sample, **{name: getattr(sample, name).flip(0) if name != "motion_global" else -sample.motion_global}
    )
    full, blind = opinionated(), opinionated(**{switch: False})
    assert max(differs(full(sample), full(other), output) for output in OUTPUTS) > 1e-3
    same(blind(sample), blind(other), 1e-12)


def test_without_parts_an_object_is_of_one_material(case, sample):
    made = network(parts=False).eval()
    prediction = made(sample)
    assert prediction.part_log_modulus.shape == (2,)
    assert prediction.part_log_modulus[0] == prediction.part_log_modulus[1]
    share = sample.part_share
    expected = float(share @ sample.prior_log_modulus)
    assert float(prediction.part_log_modulus.detach()[0]) == pytest.approx(expected, abs=0.05)
    assert float(prediction.log_modulus.detach().std()) < 0.05
    assert sum(p.numel() for p in made.parameters()) == sum(p.numel() for p in network().parameters())


def test_springs_of_a_part_have_its_modulus_on_average_and_borders_lie_between(sample):
    prediction = opinionated()(sample.to(torch.float64))
    first, second = sample.edge_part.T
    for part in (0, 1):
        inner = (first == part) & (second == part)
        torch.testing.assert_close(prediction.log_modulus[inner].mean(), prediction.part_log_modulus[part])
    quiet = network().double().eval()(sample.to(torch.float64))
    border = first != second
    low, high = quiet.part_log_modulus.min(), quiet.part_log_modulus.max()
    assert (quiet.log_modulus[border] > low + 0.2).all()
    assert (quiet.log_modulus[border] < high - 0.2).all()
    mean = quiet.part_log_modulus.mean()  # as `lattice_stiffness` takes it
    torch.testing.assert_close(quiet.log_modulus[border].median(), mean, rtol=0.01, atol=0.0)


def test_the_dashpot_keeps_the_damping_ratio_of_a_modulus_that_changed(sample):
    made = network().double().eval()
    before = made(sample.to(torch.float64))
    with torch.no_grad():
        made.part_decoder.head[-1].bias[0] = 1.0
    after = made(sample.to(torch.float64))
    shift = (after.part_log_modulus - before.part_log_modulus)[0]
    assert float(shift.detach()) > 0.5
    change = (after.global_mean - before.global_mean)[0]
    share = sample.part_share.double()
    expected = 0.5 * (share @ (after.part_log_modulus - before.part_log_modulus))
    torch.testing.assert_close(change[0], expected)
    torch.testing.assert_close(change[1:], torch.zeros_like(change[1:]))
    grips = after.log_controller_stiffness - before.log_controller_stiffness
    held = sample.point_part[sample.grips]
    torch.testing.assert_close(grips, (after.part_log_modulus - before.part_log_modulus)[held])


def test_calibration_multiplies_spreads_and_travels_with_the_weights(sample):
    made = network().eval()
    before = made(sample)
    made.calibrate(1.5, np.array([1.0, 2.0, 3.0, 4.0]))
    other = network(seed=1).eval()
    other.load_state_dict(made.state_dict())
    after = other(sample)
    torch.testing.assert_close(after.part_log_spread, 1.5 * before.part_log_spread)
    torch.testing.assert_close(after.log_modulus_spread, 1.5 * before.log_modulus_spread)
    torch.testing.assert_close(
        after.global_log_spread, before.global_log_spread * torch.tensor([1.0, 2.0, 3.0, 4.0])
    )
    torch.testing.assert_close(after.global_mean, before.global_mean)


def test_inputs_are_standardised_by_the_training_set(make_case, sample_of):
    made = network().eval()
    samples = [sample_of(make_case(seed, frames=3), seed) for seed in (0, 1)]
    big = [replace(s, motion=1e3 * s.motion + 5e2) for s in samples]
    made.standardise(samples)
    first = made(samples[0])
    made.standardise(big)
    torch.testing.assert_close(made(big[0]).log_modulus, first.log_modulus, rtol=1e-4, atol=1e-4)


def test_what_nobody_could_foresee_stays_finite(sample):
    made = opinionated()
    wild = {}
    for field in fields(sample):
        value = getattr(sample, field.name)
        if field.name in ("motion", "motion_global", "edge_features", "part_features", "scene_features"):
            wild[field.name] = 1e6 * value
    prediction = made(replace(sample, **wild).to(torch.float64))
    for name in OUTPUTS:
        assert torch.isfinite(getattr(prediction, name)).all(), name
    reach = (4.0 * sample.prior_log_spread).clamp_min(8.0) + 0.75
    assert ((prediction.part_log_modulus - sample.prior_log_modulus).abs() < reach).all()


def test_a_body_that_nothing_holds_and_a_part_without_points(case):
    free = replace(
        case.topology,
        controller_points=np.zeros((0, 3), np.float32),
        controller_springs=np.zeros((0, 2), np.int32),
        controller_rest_length=np.zeros(0, np.float32),
    )
    points = len(free.points)
    motion = MotionFeatures(np.zeros((points, 5), np.float32), np.zeros(3, np.float32))
    priors = (*case.priors, case.priors[0])  # the third has no points
    sample = make_sample(free, priors, "solid", (0.0, 0.0, -9.81), None, motion)
    prediction = network().eval()(sample)
    assert prediction.log_controller_stiffness.shape == (0,)
    assert torch.isfinite(prediction.part_log_modulus).all()
    assert float(sample.part_share[2]) == 0.0


def test_it_is_small_and_fast(sample):
    made = network().eval()
    assert sum(p.numel() for p in made.parameters()) < 1_000_000
    large = join_samples([sample] * 30)
    assert len(large.edges) > 15_000
    spent = []
    for _ in range(3):
        start = time.process_time()
        with torch.no_grad():
            made(large)
        spent.append(time.process_time() - start)
    assert min(spent) < 0.3 * torch.get_num_threads()
