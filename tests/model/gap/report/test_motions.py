"""What to film next."""

from model.gap.report.motions import CATALOGUE, next_motions
from model.gap.schema import EFFECT_NAMES


def test_the_catalogue_is_that_of_the_contract():
    assert set(CATALOGUE) == set(EFFECT_NAMES)


def test_a_class_gets_the_motion_that_separates_it(alike):
    motions = next_motions(alike.report)
    assert motions[0].startswith(CATALOGUE["wind"]["gravity_tilt"].capitalize()[:20])
    assert "tells wind from gravity tilt" in motions[0]


def test_a_second_interaction_is_asked_for_only_where_there_is_none(findings, alike):
    assert "--transfer" in next_motions(findings.report)[-1]
    assert not any("--transfer" in motion for motion in next_motions(alike.report))


def test_what_is_not_ruled_out_is_worth_a_recording(alike):
    effects = list(alike.report.effects)
    effects[0] = effects[0].model_copy(update={"confused_with": ()})
    report = alike.report.model_copy(update={"effects": tuple(effects)})
    assert "tells wind from gravity tilt" in next_motions(report)[0]


def test_a_healthy_twin_asks_for_nothing(nothing):
    assert next_motions(nothing.report) == ()
