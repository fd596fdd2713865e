import numpy as np
import pytest
from scipy.stats import spearmanr

from model.evaluation.records import GlobalRecord, PartRecord
from model.evaluation.truth import global_coverage, rank_lost, truth_scores


@pytest.fixture
def records(make_record):
    def make(truths, estimates, spreads=None):
        spreads = spreads if spreads is not None else [None] * len(truths)
        rows = zip(truths, estimates, spreads, strict=True)
        return [
            make_record(
                object_name=f"o{k}",
                parts=[PartRecord(part=0, material="fabric", log_truth=t, log_estimate=e, log_spread=s)],
            )
            for k, (t, e, s) in enumerate(rows)
        ]

    return make


def test_rank_correlation_is_spearmans_ties_included(records):
    rng = np.random.default_rng(0)
    truth = rng.integers(0, 6, 40).astype(float)
    estimate = truth + rng.integers(0, 4, 40)
    found = truth_scores(records(truth.tolist(), estimate.tolist()))
    assert found.rank.value == pytest.approx(spearmanr(truth, estimate).statistic)
    assert found.rank.low < found.rank.value < found.rank.high
    assert found.parts == 40


def test_one_answer_for_everything_has_no_correlation(records):
    assert truth_scores(records([1.0, 2.0, 3.0, 4.0], [5.0] * 4)).rank.value == 0.0


def test_error_and_bias(records):
    found = truth_scores(records([0.0, 0.0, 0.0, 0.0], [1.0, 1.0, 3.0, -1.0]))
    assert found.error.value == pytest.approx(np.sqrt(3.0))
    assert found.bias.value == pytest.approx(1.0)
    assert found.coverage is None


def test_coverage_of_a_spread_that_is_right_too_small_or_too_large(records):
    rng = np.random.default_rng(1)
    truth = rng.normal(0, 3, 2000)
    estimate = truth + rng.normal(0, 0.5, 2000)
    for stated, expected in ((0.5, 0.9), (0.25, 0.589), (5.0, 1.0)):
        some = records(truth[:400].tolist(), estimate[:400].tolist(), [stated] * 400)
        assert truth_scores(some).coverage.value == pytest.approx(expected, abs=0.04)


@pytest.mark.parametrize(("stated", "expected"), [(0.5, 0.9), (0.25, 0.589), (5.0, 1.0)])
def test_spreads_of_globals_cover_what_they_say(make_record, stated, expected):
    """Drawn as logarithms and log-odds, stated to first order in their own units, as a twin carries them."""
    rng = np.random.default_rng(2)
    made = []
    for k, (drag, odds) in enumerate(rng.normal(0.0, 0.5, (400, 2))):
        value = 1.0 / (1.0 + np.exp(-odds))
        told = {
            "drag_rate": GlobalRecord(truth=2.0 * np.exp(drag), estimate=2.0, std=2.0 * stated),
            "restitution": GlobalRecord(truth=value, estimate=0.5, std=0.25 * stated),
            "friction": GlobalRecord(truth=0.3, estimate=0.3, std=None),
        }
        made.append(make_record(object_name=f"o{k}").model_copy(update={"globals": told}))
    for name in ("drag_rate", "restitution"):
        assert global_coverage(made, name).value == pytest.approx(expected, abs=0.04)
    assert global_coverage(made, "friction") is None


def test_without_truth_nothing_is_known(records):
    found = truth_scores(records([None, None], [1.0, 2.0]))
    assert found.rank is None
    assert found.error is None
    assert found.parts == 0


def test_what_is_lost_in_rank_is_over_objects_of_both_and_paired(records):
    rng = np.random.default_rng(2)
    truth = rng.normal(0, 2, 60)
    noisy = truth + rng.normal(0, 2, 60)
    worse = noisy + rng.normal(0, 0.2, 60)
    ours, theirs, other = (records(truth.tolist(), e.tolist()) for e in (truth, noisy, worse))
    lost = rank_lost(ours, theirs[:50])
    assert lost.value == pytest.approx(1.0 - spearmanr(truth[:50], noisy[:50]).statistic)
    assert lost.objects == 50
    # two methods that err alike are told apart more sharply than their own intervals say
    close, alone = rank_lost(theirs, other), truth_scores(theirs).rank
    assert close.high - close.low < 0.5 * (alone.high - alone.low)
    assert rank_lost(ours, []) is None
    # where one told nothing of a clip, the other is not asked of it either
    again = [one.model_copy(update={"case": f"{one.case}-again", "parts": ours[0].parts}) for one in ours]
    assert rank_lost(ours, theirs) == rank_lost([*ours, *again], theirs)
