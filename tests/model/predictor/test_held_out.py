import numpy as np
import pytest
import torch

from model.predictor.batches import Example, TrueValues, make_batch
from model.predictor.held_out import HeldOut
from model.predictor.objective import Judged, LossWeights
from model.predictor.sample import Prediction


def look(case, sample, truth, said, spread, opinion):
    values = TrueValues(
        torch.zeros(len(sample.edges)), torch.tensor(truth, dtype=torch.float32), torch.zeros(1, 4)
    )
    prediction = Prediction(
        log_modulus=torch.zeros(len(sample.edges)),
        log_modulus_spread=torch.ones(len(sample.edges)),
        part_log_modulus=torch.tensor(said, dtype=torch.float32),
        part_log_spread=torch.full((2,), spread),
        log_controller_stiffness=sample.log_grip_anchor,
        global_mean=sample.global_anchor,
        global_log_spread=sample.global_spread,
    )
    return prediction, make_batch([Example(case, sample, values, opinion)])


def test_figures_are_over_all_parts_of_an_opinion(make_case, sample_of):
    case = make_case(frames=4)
    sample, held = sample_of(case), HeldOut()
    # right: perfect order, off by 0.5; wrong: reversed
    for truth, said, spread, opinion in (
        ((8.0, 9.0), (8.5, 9.5), 1.0, "right"),
        ((10.0, 11.0), (10.5, 11.5), 0.1, "right"),
        ((8.0, 9.0), (11.0, 10.0), 10.0, "wrong"),
        ((10.0, 11.0), (9.0, 8.0), 10.0, "wrong"),
    ):
        held.add_beliefs(*look(case, sample, truth, said, spread, opinion))
    found = held.figures(LossWeights())
    assert found["rank_right"] == pytest.approx(1.0)
    assert found["rank_wrong"] == pytest.approx(-1.0)
    assert found["log_error_right"] == pytest.approx(0.5, rel=1e-5)
    assert found["coverage"] == pytest.approx(6 / 8)
    assert np.isfinite(found["loss"])
    assert "future" not in found


def test_the_loss_does_not_depend_on_how_cases_fall_into_batches(make_case, sample_of):
    """Means of batches would: the second one knows nothing of one of its parts."""
    case = make_case(frames=4)
    sample, apart, joined = sample_of(case), HeldOut(), HeldOut()
    values = (((8.0, 9.0), (8.5, 11.5)), ((10.0, float("nan")), (13.0, 11.5)), ((7.0, 8.0), (7.1, 8.2)))
    each = [look(case, sample, truth, said, 1.0, None) for truth, said in values]
    for seen in each:
        apart.add_beliefs(*seen)
    names = ("log_modulus", "log_modulus_spread", "part_log_modulus", "part_log_spread")
    names += ("log_controller_stiffness", "global_mean", "global_log_spread")
    whole = Prediction(**{name: torch.cat([getattr(said, name) for said, _ in each]) for name in names})
    joined.add_beliefs(whole, make_batch([batch.examples[0] for _, batch in each]))
    assert joined.figures(LossWeights())["loss"] == pytest.approx(apart.figures(LossWeights())["loss"])


def test_motion_adds_to_the_loss_and_divergence_is_a_share(make_case, sample_of):
    case, held = make_case(frames=4), HeldOut()
    held.add_beliefs(*look(case, sample_of(case), (8, 9), (8, 9), 1.0, None))
    still = held.figures(LossWeights())["loss"]
    held.add_motion(Judged(track=0.2, chamfer=0.4, past=0.01, future=0.02))
    held.add_motion(Judged(track=0.4, chamfer=0.4, past=0.01, future=float("nan")))
    held.add_motion(Judged(track=0.9, chamfer=1.0, past=0.04, future=0.05, diverged=True))
    found = held.figures(LossWeights(track=2.0, chamfer=0.5))
    assert found["loss"] == pytest.approx(still + 2.0 * 0.5 + 0.5 * 0.6)
    assert found["diverged"] == pytest.approx(1 / 3)
    assert found["future"] == pytest.approx(0.035)
    assert held.rolled == 3
    assert np.isfinite(list(found.values())).all()


def test_a_clip_without_a_future_leaves_it_out(make_case, sample_of):
    case, held = make_case(frames=4), HeldOut()
    held.add_beliefs(*look(case, sample_of(case), (8, 9), (8, 9), 1.0, None))
    still = held.figures(LossWeights())["loss"]
    held.add_motion(Judged(track=0.2, chamfer=0.4, past=0.01, future=float("nan")))
    found = held.figures(LossWeights(track=1.0, chamfer=0.0))
    assert "future" not in found
    assert found["loss"] == pytest.approx(still + 0.2)


def test_what_several_processes_gather_counts_as_if_one_had(make_case, sample_of):
    case = make_case(frames=4)
    sample, whole, shares = sample_of(case), HeldOut(), (HeldOut(), HeldOut())
    for number, (truth, said) in enumerate((((8, 9), (8, 10)), ((10, 11), (9, 12)), ((7, 12), (7, 8)))):
        seen = look(case, sample, truth, said, 1.0, "right")
        moved = Judged(0.1 * number, 0.2, 0.01, 0.02, diverged=number == 1)
        for held in (whole, shares[number % 2]):
            held.add_beliefs(*seen)
            held.add_motion(moved)
    joined = HeldOut.joined(shares)
    assert joined.rolled == 3
    assert joined.figures(LossWeights()) == pytest.approx(whole.figures(LossWeights()))
    assert shares[0].figures(LossWeights())["rank_right"] != joined.figures(LossWeights())["rank_right"]
    assert whole.gathered() is whole
