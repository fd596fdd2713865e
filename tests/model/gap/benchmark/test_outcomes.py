import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from model.errors import InputError
from model.gap.benchmark.amplitudes import TRUE_VALUES
from model.gap.benchmark.outcomes import REFUSED, answers_of, outcomes
from model.gap.benchmark.predict import Prediction
from model.gap.effects import ALL_EFFECTS
from model.gap.schema import EFFECT_NAMES


def one(prediction, label):
    (outcome,) = outcomes({label["world"]: prediction}, [label])
    return outcome


def test_answers_are_ranked_with_none_and_unknown_among_them(report_of):
    answers = answers_of(report_of("wind", probability=0.4, second="damage"))
    assert answers[:2] == ("wind", "damage")
    assert sorted(answers) == sorted([*EFFECT_NAMES, "none", "unknown"])
    nothing = answers_of(report_of("none", probability=0.5))
    assert nothing[0] == "none"
    assert nothing[4] == "unknown", "0.05 is left for it, behind 0.225, 0.1125 and 0.056"


def test_right_is_what_is_accepted(said, label_of):
    assert one(said("wind"), label_of("a", "wind")).right
    assert one(said("none"), label_of("a")).right
    wrong = one(said("damage"), label_of("a", "wind"))
    assert (wrong.right, wrong.truth, wrong.answer) == (False, "wind", "damage")
    lag = label_of("a", accepted=["actuation_delay", "none"], category="actuation")
    assert one(said("actuation_delay"), lag).right


def test_of_two_effects_the_first_counts_and_both_are_noted(said, label_of):
    label = label_of("a", "wind", "damage")
    alone, other = one(said("damage"), label), one(said("damage", second="plasticity"), label)
    assert alone.right
    assert not alone.both
    assert alone.truth == "damage"
    assert not other.both
    assert one(said("damage", second="wind", probability=0.4), label).both


def test_who_refuses_is_wrong_and_knows_no_place(label_of):
    outcome = one(Prediction(None, "too short"), label_of("a", "wind"))
    assert outcome.answers == (REFUSED,)
    assert not outcome.right
    assert (outcome.area, outcome.overlap, outcome.confidence) == (0.5, 0.0, 0.0)


def test_where_is_compared_with_the_label(said, label_of):
    label = label_of("a", "wind", acts_on=(1.0, 1.0, 0.0, 0.0, 0.0, 0.0))
    outcome = one(said("wind", acts_on=(0.9, 0.2, 0.6, 0.0, 0.0, 0.0)), label)
    assert outcome.area == pytest.approx(7 / 8), "one pair of eight is in the wrong order"
    assert outcome.overlap == pytest.approx(1 / 3)
    everywhere = one(said("wind"), label_of("a", "wind", acts_on=(1.0,) * 6))
    assert np.isnan(everywhere.area)
    with pytest.raises(InputError, match="expected 6 values in acts_on, found 2"):
        one(said("wind"), label_of("a", "wind", acts_on=(1.0, 0.0)))


def test_intervals_are_held_against_the_truth(said, label_of):
    fitted = {"delay": {"value": -0.09, "unit": "s", "ci95": [-0.11, -0.07]}}
    label = label_of("a", "actuation_delay", amplitude=0.1)
    assert one(said("actuation_delay", parameters=fitted), label).covered == {"actuation_delay.delay": True}
    label = label_of("a", "actuation_delay", amplitude=0.2)
    assert one(said("actuation_delay", parameters=fitted), label).covered == {"actuation_delay.delay": False}
    assert one(said("wind"), label).covered == {}
    assert one(said("damage"), label_of("a", "damage")).covered == {}, "softening means another thing there"


def test_comparable_quantities_are_ours():
    kinds = {kind.name: kind for kind in ALL_EFFECTS}
    effect = {"amplitude": 0.5, "options": {"sign": 1.0, "direction": (0.6, 0.8, 0.0)}}
    for name, values in TRUE_VALUES.items():
        assert set(values(effect)) <= set(kinds[name].quantities), name


def test_a_push_of_gravity_is_the_tilt_that_our_effect_makes():
    angles = TRUE_VALUES["gravity_tilt"]({"amplitude": 1.2, "options": {"direction": (0.6, -0.8, 0.0)}})
    about_x, about_y = (Rotation.from_euler(axis, angles[f"about_{axis}"]) for axis in "xy")
    pushed = np.array([0.72, -0.96, -9.81])
    tilted = (about_y * about_x).apply([0.0, 0.0, -1.0])
    np.testing.assert_allclose(tilted, pushed / np.linalg.norm(pushed), atol=1e-12)


def test_labels_and_worlds_belong_together(said, label_of):
    with pytest.raises(InputError, match="b: there is a label but no world"):
        outcomes({"a": said("none")}, [label_of("a"), label_of("b")])
    with pytest.raises(InputError, match="a: there is a world but no label"):
        outcomes({"a": said("none")}, [])
