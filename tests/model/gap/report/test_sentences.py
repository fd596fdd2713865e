"""Where, when and from what source."""

from model.gap.report.sentences import sentences, title


def test_titles(findings, alike, nothing, unknown):
    titles = [title(case.report) for case in (findings, alike, nothing, unknown)]
    assert titles == [
        "Missing: wind",
        "Missing: wind or gravity tilt",
        "Nothing is missing",
        "Something unknown is missing",
    ]


def test_a_twin_that_is_far_off_is_not_said_to_lack_nothing(nothing):
    gap = nothing.report.gap.model_copy(update={"refit": 5 * nothing.report.gap.noise_floor})
    off = nothing.report.model_copy(update={"gap": gap})
    assert title(off) == "No missing effect stands out"
    unsure = off.verdict.model_copy(update={"probability": 0.3})
    assert title(off.model_copy(update={"verdict": unsure})) == "Likeliest: no missing effect stands out"


def test_they_carry_the_numbers_of_the_report(report):
    told = " ".join(sentences(report))
    phase = max(report.where.phases, key=lambda each: each.share)
    assert f"{100 * phase.share:.0f} % of the gap falls into the phase “{phase.name}”" in told
    assert "on the part “lower half”" in told
    assert "Wind acts on the whole object." in told
    assert "58 % of what the twin was off by before any refit, squared, on held-out time, is physics" in told


def test_half_of_an_even_gap_lies_on_half_of_the_points(report):
    count = len(report.where.points)
    where = report.where.model_copy(update={"points": (1 / count,) * count, "parts": ()})
    assert "Half of the gap lies on 50 % of the points." in sentences(
        report.model_copy(update={"where": where})
    )


def test_an_effect_in_one_place_is_told_so(report):
    count = len(report.where.points)
    acts = (1.0,) * (count // 4) + (0.0,) * (count - count // 4)
    where = report.where.model_copy(update={"acts_on": acts})
    assert "Wind acts mainly on 25 % of the points." in sentences(report.model_copy(update={"where": where}))


def test_of_two_effects_it_is_told_where_the_first_acts(report):
    verdict = report.verdict.model_copy(update={"second": "plasticity"})
    told = sentences(report.model_copy(update={"verdict": verdict}))
    assert "Wind acts on the whole object." in told


def test_without_phases_and_effect_there_is_less_to_say(nothing):
    where = nothing.report.where.model_copy(update={"phases": ()})
    told = sentences(nothing.report.model_copy(update={"where": where}))
    assert not any("phase" in text or "acts" in text for text in told)


def test_a_refit_that_does_not_help_is_told(report):
    gap = report.gap.model_copy(update={"baseline": report.gap.refit})
    assert "does not help" in sentences(report.model_copy(update={"gap": gap}))[0]


def test_a_refit_that_foretells_worse_is_told_with_both_errors(report):
    gap = report.gap.model_copy(update={"baseline": 0.0073, "refit": 0.0343})
    told = sentences(report.model_copy(update={"gap": gap}))[0]
    assert told.endswith("makes the error on held-out time larger (7.3 mm to 34.3 mm).")
