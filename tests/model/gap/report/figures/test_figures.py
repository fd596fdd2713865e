"""What every figure has to do, and what each one shows."""

import io
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from model.gap.report.figures import ALL_DRAWINGS, closure, course, place, ranking, rollouts
from model.gap.report.style import DPI, WIDTH, png
from model.gap.report.wording import millimetres

CASES = ("findings", "alike", "pair", "nothing", "unknown")
DRAWINGS = [pytest.param(each, id=each.file) for each in ALL_DRAWINGS]


def texts(figure):
    """All words on a figure."""
    figure.draw_without_rendering()
    return "\n".join(text.get_text() for text in figure.findobj(lambda artist: hasattr(artist, "get_text")))


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("drawing", DRAWINGS)
def test_a_figure_is_a_png_with_ink(drawing, case, request):
    image = Image.open(io.BytesIO(png(drawing.draw(request.getfixturevalue(case)))))
    assert image.format == "PNG"
    assert image.width == round(WIDTH * DPI)
    assert 0.005 < (np.asarray(image.convert("L")) < 200).mean() < 0.6


@pytest.mark.parametrize("case", ["alike", "pair", "late"])
@pytest.mark.parametrize("drawing", DRAWINGS)
def test_nothing_sticks_out_of_a_figure(drawing, case, request):
    figure = drawing.draw(request.getfixturevalue(case))
    figure.draw_without_rendering()
    box, page = figure.get_tightbbox(), figure.bbox_inches
    assert box.x0 >= page.x0 - 0.02
    assert box.y0 >= page.y0 - 0.02
    assert box.x1 <= page.x1 + 0.02
    assert box.y1 <= page.y1 + 0.02


@pytest.mark.parametrize("drawing", DRAWINGS)
def test_one_point_and_frames_without_sight_are_drawn_as_well(drawing, findings):
    observed = findings.observed[:3, :1].copy()
    observed[1] = np.nan
    observed[[0, 2]] = 0.1
    where = findings.report.where.model_copy(
        update={"points": (1.0,), "acts_on": (1.0,), "frames": (0.5, 0, 0.5)}
    )
    error = np.array([1e-3, np.nan, 2e-3])
    small = replace(
        findings,
        report=findings.report.model_copy(update={"where": where}),
        times=findings.times[:3],
        observed=observed,
        before=findings.before[:3, :1],
        after=findings.after[:3, :1],
        rest=findings.rest[:1],
        controllers=np.zeros((3, 0, 3)),
        error_baseline=error,
        error_refit=error,
        error_after=error,
    )
    assert png(drawing.draw(small)).startswith(b"\x89PNG")


def test_bars_are_as_long_as_the_figures_of_the_report(alike):
    figure = closure.draw(alike)
    gap = alike.report.gap
    values = [gap.baseline, gap.refit, gap.with_effect, gap.ceiling, gap.noise_floor]
    for axes in figure.axes:
        assert [bar.get_width() for bar in axes.patches] == pytest.approx([1e3 * value for value in values])
        assert "[mm]" in figure.axes[-1].get_xlabel()
    own, other = figure.axes
    assert len(own.lines) == 3  # the intervals that are known
    assert len(other.lines) == 0
    low, high = own.lines[0].get_xdata()
    assert (low, high) == pytest.approx((900 * gap.baseline, 1100 * gap.baseline))


def test_without_an_effect_there_is_no_bar_for_it(nothing):
    assert "wind" not in texts(closure.draw(nothing))


def test_the_ranking_has_all_probability(findings, alike, nothing, unknown):
    for case in (findings, alike, nothing, unknown):
        assert sum(bar.probability for bar in ranking.ranked(case.report)) == pytest.approx(1.0)


def test_the_verdict_is_on_top_and_its_class_bracketed(alike):
    bars = ranking.ranked(alike.report)
    assert [(bar.name, bar.role) for bar in bars[:2]] == [("wind", "verdict"), ("gravity tilt", "class")]
    assert "cannot\ntell these apart" in texts(ranking.draw(alike))


def test_a_clear_verdict_has_no_bracket(findings):
    assert "apart" not in texts(ranking.draw(findings))


@pytest.mark.parametrize(
    ("case", "top"), [("nothing", "nothing is missing"), ("unknown", "something unknown")]
)
def test_none_and_unknown_are_answers(case, top, request):
    bars = ranking.ranked(request.getfixturevalue(case).report)
    assert (bars[0].name, bars[0].role) == (top, "verdict")


def test_the_course_has_the_errors_the_phases_and_what_was_held_out(findings):
    figure = course.draw(findings)
    axes = figure.axes[0]
    shown = {line.get_label(): line for line in axes.lines}
    assert shown["with wind"].get_ydata() == pytest.approx(1e3 * findings.error_after)
    assert shown["refitted twin"].get_ydata() == pytest.approx(1e3 * findings.error_refit)
    words = texts(figure)
    for phase in findings.report.where.phases:
        assert phase.name in words
    spans = [tuple(line.get_xdata()) for line in axes.lines if len(line.get_xdata()) == 2]
    assert findings.report.gap.heldout[0] in spans


def test_names_of_phases_keep_within_them(findings):
    ends = [0.0, 0.1, 0.35, 0.7, 1.0, 2.0, float(findings.times[-1])]
    names = ["lifted", "let back", "stretched", "held still", "held still, touching the ground", "free"]
    phases = tuple(
        findings.report.where.phases[0].model_copy(
            update={"name": name, "start_s": start, "end_s": end, "share": 0.1}
        )
        for name, (start, end) in zip(names, pairwise(ends), strict=True)
    )
    where = findings.report.where.model_copy(update={"phases": phases})
    case = replace(findings, report=findings.report.model_copy(update={"where": where}))
    figure = course.draw(case)
    figure.draw_without_rendering()
    axes = figure.axes[0]
    boxes = {text.get_text(): text.get_window_extent() for text in axes.texts if "%" in text.get_text()}
    assert "held still,\ntouching the ground\n10 %" in boxes
    assert "free\n10 %" in boxes
    assert not any(text.startswith(("lifted", "let back")) for text in boxes)
    for text, box in boxes.items():
        phase = phases[names.index(text.rsplit("\n", 1)[0].replace("\n", " "))]
        left, right = axes.transData.transform([(phase.start_s, 0.0), (phase.end_s, 0.0)])[:, 0]
        assert left < box.x0 < box.x1 < right


def test_a_twin_that_came_far_off_does_not_flatten_the_others(findings):
    far = replace(findings, error_baseline=findings.error_baseline + 50.0)
    highest = 1e3 * findings.error_refit.max()
    assert course.draw(far).axes[0].get_ylim()[1] < 6 * highest


def test_the_object_has_a_row_for_the_effect_only_where_it_acts(findings, nothing):
    assert "Where wind acts" in texts(place.draw(findings))
    assert "acts" not in texts(place.draw(nothing))


def test_colours_follow_the_share_of_the_average_point(findings):
    axes = place.draw(findings).axes[0]
    drawn = axes.collections[1].get_array()
    share = np.array(findings.report.where.points) * len(findings.rest)
    assert np.allclose(np.sort(drawn), np.sort(share))


def test_moments_are_the_middles_of_quarters_that_are_seen(findings):
    frames = rollouts.moments(findings)
    assert len(frames) == rollouts.MOMENTS
    assert np.abs(np.array(frames) / 90 - [0.125, 0.375, 0.625, 0.875]).max() < 0.05
    observed = findings.observed.copy()
    observed[frames] = np.nan
    moved = rollouts.moments(replace(findings, observed=observed))
    assert not set(moved) & set(frames)
    observed[45:68] = np.nan
    assert len(rollouts.moments(replace(findings, observed=observed))) == 3


def test_each_moment_tells_how_far_off_each_twin_is(findings):
    frame = rollouts.moments(findings)[0]
    words = texts(rollouts.draw(findings))
    for rollout in (findings.before, findings.after):
        off = np.nanmean(np.linalg.norm(rollout[frame] - findings.observed[frame], axis=-1))
        assert f"{millimetres(off)} off" in words
    assert len(re.findall("held out", words)) == 1


@pytest.mark.parametrize("case", ["alike", "pair", "late"])
def test_words_of_the_rollouts_keep_apart(case, request):
    figure = rollouts.draw(request.getfixturevalue(case))
    figure.draw_without_rendering()
    titles = [axes.title.get_window_extent() for axes in figure.axes[:2]]
    assert titles[0].x1 < titles[1].x0
    for axes in figure.axes:
        if axes.get_ylabel():
            assert axes.yaxis.label.get_window_extent().x1 < axes.get_window_extent().x0
    written = [text.get_window_extent() for axes in figure.axes[:2] for text in axes.texts if text.get_text()]
    assert min(title.y0 for title in titles) > max(text.y1 for text in written[:1])


def test_what_is_held_beside_the_object_is_in_the_picture(findings):
    """Of a long thin object a few points make the end, and these are the ones that a hand holds."""
    before = findings.before.copy()
    before[:, 0] = before.mean(1) + 0.7 * np.ptp(findings.rest, axis=0)
    figure = rollouts.draw(replace(findings, before=before))
    figure.draw_without_rendering()
    panels = [axes for axes in figure.axes if axes.collections]
    for axes, frame in zip(panels[::2], rollouts.moments(findings), strict=True):
        (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
        rings = axes.collections[-2].get_offsets()
        inside = (rings >= [left, low]).all(1) & (rings <= [right, high]).all(1)
        assert inside.all(), frame


def test_a_twin_that_flew_away_leaves_the_panel(findings):
    after = findings.after + 1e3
    panel = rollouts.draw(replace(findings, after=after)).axes[0]
    assert np.ptp(panel.get_xlim()) < 5 * np.ptp(findings.rest, axis=0).max()


@pytest.mark.parametrize("case", ["findings", "unknown"])
def test_all_moments_are_shown_at_one_scale(case, request):
    figure = rollouts.draw(request.getfixturevalue(case))
    figure.draw_without_rendering()
    scales = [np.ptp(axes.get_xlim()) / axes.get_window_extent().width for axes in figure.axes]
    assert scales == pytest.approx([scales[0]] * len(scales), rel=0.01)
