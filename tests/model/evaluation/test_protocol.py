from dataclasses import dataclass, replace

import numpy as np
import pytest

from model.evaluation.baselines import HoldLast, Method, Twin
from model.evaluation.baselines.base import PartBelief
from model.evaluation.hidden import answer, seen_until_split, unseen
from model.evaluation.protocol import Task, judge, scored
from model.predictor.prior_mean import PriorMeanPredictor
from model.scenes.replay import replay


@pytest.fixture(scope="module")
def cases(object_cases):
    return object_cases(3)


def task(method, case, *others, own=None):
    return Task(key="k", name=method.name, method=method, case=case, own=own or case, others=others)


class Peeking(Method):
    """Copies whatever of the answer it can get hold of."""

    name = "peeking"

    def fit(self, case):
        assert case.truth is None
        assert case.complete is None
        return Copied(case.observation.points.copy(), case.split)


@dataclass
class Copied:
    points: np.ndarray
    split: int
    parameters = None
    part_belief = None

    def predict(self, case):
        assert case.truth is None
        assert case.complete is None
        seen = case.observation.points
        return seen if np.isfinite(seen[-1]).any() else np.where(np.isfinite(seen), seen, self.filler(case))

    def filler(self, case):
        return np.where(np.isfinite(self.points), self.points, case.rest[None])


def test_the_future_and_the_truth_are_not_in_what_a_method_is_given(cases):
    case, other = cases
    shown, asked = seen_until_split(case), unseen(other, case.priors)
    assert np.isfinite(shown.observation.points[: case.split]).all()
    assert np.isnan(shown.observation.points[case.split :]).all()
    assert np.isnan(asked.observation.points).all()
    for hidden in (shown, asked):
        assert hidden.truth is None
        assert hidden.complete is None
    # and the case itself is as it was
    assert np.isfinite(case.observation.points).all()
    assert case.truth is not None


def test_what_peeks_gets_what_it_saw_right_and_nothing_else(cases):
    case, other = cases
    record = judge(task(Peeking(), case, other))
    assert record.failed is None
    assert [each.failed for each in record.unseen] == [None], "no truth was in the other clip"
    assert record.reconstruction["track"] == pytest.approx(0.0, abs=1e-7)
    held = scored(case, np.repeat(case.rest[None], 12, axis=0), range(case.split, 12))
    assert record.future["track"] == pytest.approx(held["track"])
    # the other clip is not the first one, so that copying the first does not help there
    assert record.unseen[0].scores["track"] > 0.01


def test_scores_are_of_the_truth_and_not_of_the_noise(make_case):
    case = make_case(frames=10, noise=0.01)
    assert scored(case, case.complete, range(1, 10))["track"] == 0.0
    bare = replace(case, complete=None)
    assert answer(bare) is bare.observation.points
    assert scored(bare, case.complete, range(1, 10))["track"] == pytest.approx(0.016, rel=0.1)


def test_the_error_over_time_has_every_frame(make_case):
    """Also those of which nothing is known: else what comes after them is drawn too early."""
    case = make_case(frames=9)
    points = case.complete.copy()
    points[3:6] = np.nan
    gap = replace(case, complete=points, truth=None)
    curve = judge(task(HoldLast(), gap, gap)).curve
    assert len(curve) == 9
    np.testing.assert_allclose(curve[2:7], np.linspace(curve[2], curve[6], 5), atol=1e-6)


def test_no_frames_no_scores(cases):
    assert scored(cases[0], cases[0].complete, range(0)) == {}


class Knowing(Method):
    """Knows the truth from elsewhere, which no fair method does."""

    name = "knowing"

    def __init__(self, parameters, belief=None):
        self.parameters, self.belief = parameters, belief

    def fit(self, case):
        return Twin(case.topology, self.parameters, self.belief)


@pytest.fixture(scope="module")
def true_parameters(cases):
    from model.types import Estimate

    case = cases[0]
    sure = tuple(
        replace(p, properties={**p.properties, "stiffness": Estimate(float(m), 0.1, "Pa")})
        for p, m in zip(case.priors, case.truth.modulus, strict=True)
    )
    return PriorMeanPredictor().from_priors(case.topology, sure, "solid", case.observation.gravity, 0.0)


def test_the_true_parameters_score_zero_in_every_setting(cases, true_parameters):
    case, other = cases
    np.testing.assert_allclose(replay(case, true_parameters), case.complete, atol=1e-6)
    record = judge(task(Knowing(true_parameters), case, other))
    for scores in (record.reconstruction, record.future, record.unseen[0].scores):
        assert max(scores.values()) < 1e-5
    assert len(record.curve) == 12
    for part, modulus in zip(record.parts, case.truth.modulus, strict=True):
        assert part.log_truth == pytest.approx(np.log(modulus))
        assert part.log_estimate == pytest.approx(np.log(modulus), abs=1e-3)
        assert part.log_spread is None
    assert [part.material for part in record.parts] == ["fabric", "leather"]
    friction = record.globals["friction"]
    assert friction.estimate == pytest.approx(friction.truth)


def test_a_modulus_is_compared_at_the_density_of_the_truth(cases, true_parameters):
    # told half the density, a method takes the object for twice as large, its springs for half the modulus
    from model.types import Estimate

    case = cases[0]
    lighter = tuple(
        replace(
            p,
            properties={**p.properties, "density": Estimate(p.properties["density"].mean / 2, 0.1, "kg/m^3")},
        )
        for p in case.priors
    )
    told = replace(case, priors=lighter)
    record = judge(task(Knowing(true_parameters), told, own=case))
    belief = PartBelief(np.log(case.truth.modulus / 2.0), np.full(2, 0.3))
    stated = judge(task(Knowing(true_parameters, belief), told, own=case))
    for one in (record, stated):
        for part, modulus in zip(one.parts, case.truth.modulus, strict=True):
            assert part.log_estimate == pytest.approx(np.log(modulus), abs=1e-3)
    assert stated.parts[0].log_spread == pytest.approx(0.3)


class Broken(Method):
    name = "broken"

    def fit(self, case):
        raise ValueError("two\nlines")


class Saying:
    """What a method made of a case, if it is nothing but what it says of the motion."""

    parameters = None
    part_belief = None

    def __init__(self, predict):
        self.predict = predict


class Wild(Method):
    name = "wild"

    def fit(self, case):
        return Saying(lambda case: np.full_like(case.observation.points, np.inf))


class Flying(Method):
    name = "flying"

    def fit(self, case):
        return Saying(lambda case: case.rest + np.linspace(0, 11, len(case.observation.times))[:, None, None])


class Short(Method):
    name = "short"

    def fit(self, case):
        return Saying(lambda case: np.zeros((2, 3, 3), np.float32))


class Forgetful(HoldLast):
    name = "forgetful"

    def knew(self, source, object_name):
        raise ValueError("no idea")


def test_who_cannot_say_what_it_was_trained_on_has_failed(cases):
    record = judge(replace(task(Forgetful(), *cases), source="a" * 64))
    assert record.failed == "ValueError: no idea"
    assert record.unseen[0].failed == "ValueError: no idea"
    assert not record.known_object
    assert record.future == judge(task(HoldLast(), *cases)).future


@pytest.mark.parametrize(
    ("method", "reason"),
    [
        (Broken, "ValueError: two lines"),
        (Wild, "not finite"),
        (Flying, "more than 10 m from where it lay"),
        (Short, "shape (2, 3, 3)"),
    ],
)
def test_what_fails_counts_as_if_nothing_moved_any_more_and_says_so(cases, method, reason):
    record = judge(task(method(), *cases))
    held = judge(task(HoldLast(), *cases))
    assert reason in record.failed
    assert reason in record.unseen[0].failed
    assert held.failed is None
    assert record.parts == []
    assert record.future == held.future
    assert record.unseen[0].scores == held.unseen[0].scores
