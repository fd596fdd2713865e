"""One plain sentence for each kind of verdict, with the numbers of the report."""

import pytest

from model.gap.report.sentences import title
from model.gap.report.statement import stated, statement
from model.gap.report.wording import millimetres, percent


def test_an_effect(report):
    text = statement(report)
    assert text.startswith("Wind is missing in the twin (93 % sure): with it the error")
    for value in (report.gap.refit, report.gap.with_effect):
        assert millimetres(value) in text
    assert f"closes {percent(report.gap.closed_fraction)} of the reducible gap (95 % interval" in text


def test_a_class_names_all_its_members_and_their_probability_together(alike):
    text = statement(alike.report)
    assert text.startswith(
        "Wind or gravity tilt is missing in the twin (95 % sure); this recording cannot tell"
    )
    assert "wind is the likeliest (58 %)" in text
    assert "on the other interaction" in text


def test_two_effects(report):
    verdict = report.verdict.model_copy(update={"second": "plasticity"})
    text = statement(report.model_copy(update={"verdict": verdict}))
    assert text.startswith(
        "Wind and plasticity are missing in the twin (93 % sure): with wind and plasticity"
    )


def test_nothing(nothing):
    text = statement(nothing.report)
    assert text.startswith("Nothing is missing in the twin (97 % sure): once its own parameters are refitted")
    assert millimetres(nothing.report.gap.noise_floor) in text


def test_nothing_says_nothing_of_refitting_where_it_changed_little(nothing):
    gap = nothing.report.gap.model_copy(update={"baseline": nothing.report.gap.refit})
    assert "refitted" not in statement(nothing.report.model_copy(update={"gap": gap}))


@pytest.mark.parametrize("kind", ["nothing", "unknown"])
def test_what_is_hardly_likelier_than_others_is_not_said_outright(kind, request):
    report = request.getfixturevalue(kind).report
    verdict = report.verdict.model_copy(update={"probability": 0.31})
    unsure = report.model_copy(update={"verdict": verdict})
    assert "likeliest answer" in statement(unsure)
    assert "(31 % sure)" in statement(unsure)
    assert title(unsure).startswith("Likeliest: ")
    assert "likeliest answer" not in statement(report)


def test_nor_is_a_class(alike):
    effects = [
        each.model_copy(update={"probability": 0.2}) if each.name in {"wind", "gravity_tilt"} else each
        for each in alike.report.effects
    ]
    verdict = alike.report.verdict.model_copy(update={"probability": 0.2})
    unsure = alike.report.model_copy(update={"verdict": verdict, "effects": tuple(effects)})
    assert statement(unsure).startswith(
        "Wind or gravity tilt is the likeliest thing that the twin lacks (40 % sure)"
    )
    assert title(unsure) == "Likeliest to be missing: wind or gravity tilt"


def test_unknown_tells_what_the_best_known_effect_leaves(unknown):
    text = statement(unknown.report)
    assert text.startswith("Something is missing in the twin that the catalogue does not have (88 % sure)")
    assert "the best known effect, wind, leaves 3.7 mm" in text
    assert f"a free force would leave {millimetres(unknown.report.gap.ceiling)}" in text


def test_a_gap_within_noise_gets_no_share(report):
    gap = report.gap.model_copy(update={"closed_fraction": None, "closed_fraction_ci95": None})
    text = statement(report.model_copy(update={"gap": gap}))
    assert "too small against noise" in text
    assert "closes" not in text


def test_an_error_that_grows_does_not_fall(report):
    gap = report.gap.model_copy(update={"with_effect": 2 * report.gap.refit, "closed_fraction": None})
    assert " goes from " in statement(report.model_copy(update={"gap": gap}))


def test_what_closes_nothing_is_said_to_close_nothing(report):
    gap = report.gap.model_copy(update={"with_effect": 1.2 * report.gap.refit, "closed_fraction": -0.25})
    text = statement(report.model_copy(update={"gap": gap}))
    assert "which closes nothing of the reducible gap" in text
    assert "−" not in text


@pytest.mark.parametrize(
    ("with_effect", "closed", "says"),
    [
        (0.030, None, "; on the other interaction it helps nothing (10.0 mm to 30.0 mm)"),
        (0.012, -0.2, "; on the other interaction it helps nothing (10.0 mm to 12.0 mm)"),
        (0.010, 0.0, "; on the other interaction, where it does not act, the error stays 10.0 mm"),
        (0.009, None, "; on the other interaction the gap is too small against noise to say"),
        (0.004, 0.7, ", and 70 % on the other interaction"),
    ],
)
def test_the_other_interaction_is_never_left_out(alike, with_effect, closed, says):
    other = alike.report.gap.transfer.model_copy(
        update={"refit": 0.010, "with_effect": with_effect, "closed_fraction": closed}
    )
    gap = alike.report.gap.model_copy(update={"transfer": other})
    assert says in statement(alike.report.model_copy(update={"gap": gap}))


@pytest.mark.parametrize("case", ["findings", "alike", "nothing", "unknown"])
def test_it_is_one_sentence_on_one_line(case, request):
    text = statement(request.getfixturevalue(case).report)
    assert text.endswith(".")
    assert ". " not in text
    assert "\n" not in text
    assert "_" not in text


def test_a_statement_that_is_there_stays(report):
    assert stated(report).verdict.statement == statement(report)
    own = report.model_copy(update={"verdict": report.verdict.model_copy(update={"statement": "Mine."})})
    assert stated(own).verdict.statement == "Mine."
