from itertools import pairwise

import numpy as np
import pytest

from model.evaluation.figures import calibration, errors, figures, over_time, stiffness
from model.evaluation.protocol import SETTINGS
from model.evaluation.records import PartRecord


@pytest.fixture
def of(make_record):
    rng = np.random.default_rng(0)
    rows = []
    for k in range(200):
        truth = float(rng.normal(9, 1))
        part = PartRecord(
            part=0,
            material="fur",
            log_truth=truth,
            log_estimate=truth + float(rng.normal(0, 0.5)),
            log_spread=0.5,
        )
        rows.append(make_record("ours", f"o{k}", parts=[part]))
    return {"ours": rows, "theirs": [make_record("theirs", f"o{k}", track=0.02) for k in range(5)]}


def test_figures_are_drawn_of_what_is_known(of):
    assert set(figures(of, SETTINGS)) == {"errors.png", "time.png", "stiffness.png", "calibration.png"}
    assert set(figures({"theirs": of["theirs"]}, SETTINGS)) == {"errors.png", "time.png"}


def test_errors_show_the_means_in_millimetres(of):
    panels = errors(of, ("reconstruction", "future")).axes
    means = [container.lines[0].get_xdata()[0] for panel in panels for container in panel.containers]
    assert means == pytest.approx([10.0, 20.0, 20.0, 40.0])


def test_titles_of_neighbouring_panels_do_not_meet(of):
    named = {"prior-mean-synchronised": of["theirs"]}
    figure = errors(named, ("reconstruction", "future", "unseen_interaction"))
    figure.canvas.draw()
    boxes = [panel.title.get_window_extent() for panel in figure.axes]
    gaps = [after.x0 - before.x1 for before, after in pairwise(boxes)]
    assert min(gaps) > 0.3 * figure.dpi


def test_curves_end_where_the_records_end(of):
    lines = {line.get_label(): line.get_ydata() for line in over_time(of).axes[0].lines}
    assert lines["ours"][-1] == pytest.approx(20.0)
    assert lines["theirs"][0] == 0.0


def test_a_spread_that_is_right_lies_on_the_diagonal(of):
    lines = {line.get_label(): line for line in calibration({"ours": of["ours"]}).axes[0].lines}
    np.testing.assert_allclose(lines["ours"].get_ydata(), lines["ours"].get_xdata(), atol=0.08)


def test_moduli_are_drawn_as_powers_of_ten(of):
    (panel,) = stiffness({"ours": of["ours"]}).axes
    points = panel.collections[0].get_offsets()
    assert points.shape == (200, 2)
    assert points[:, 0].mean() == pytest.approx(9.0 / np.log(10.0), abs=0.1)


def test_no_two_methods_of_a_full_table_share_a_colour(of):
    """All baselines beside ours: the tenth method once looked like the first."""
    many = {f"method {k}": of["theirs"] for k in range(12)}
    lines = over_time(many).axes[0].lines
    colours = {line.get_color() for line in lines if line.get_label() in many}
    assert len(colours) == 12


@pytest.mark.parametrize("draw", [over_time, calibration])
def test_names_of_a_full_table_cover_no_line(of, draw):
    figure = draw({f"nearest-anchors-synchronised {k}": of["ours"] for k in range(12)})
    figure.draw_without_rendering()
    (names,), (panel,) = figure.legends, figure.axes
    assert names.get_window_extent().x0 >= panel.get_window_extent().x1
    assert names.get_window_extent().y0 >= 0.0
    assert names.get_window_extent().x1 <= figure.bbox.x1
