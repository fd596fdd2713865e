import json

import numpy as np
import pytest

from model.errors import InputError
from model.observation import write_observation
from model.playground.report import read_where
from model.types import Observation


def seen(folder, places):
    """An observation of points that start at `places`."""
    times = np.arange(40) / 30
    path = folder / "seen.npz"
    sway = np.float32(0.05) * np.sin(4 * times).astype(np.float32)[:, None, None] * np.float32([1, 0, 0])
    write_observation(path, Observation(times, places[None] + sway, places[None, :1] + sway))
    return path


@pytest.fixture
def report(tmp_path):
    """Writes a report about so many points: the gap is all at the first, the effect at the last."""

    def write(count):
        from model.gap.schema import EFFECT_NAMES

        share = [1.0] + [0.0] * (count - 1)
        effects = [{"name": name, "probability": 0.0} for name in EFFECT_NAMES]
        content = {
            "schema": "matphys.gap/1",
            "verdict": {"effect": "none", "probability": 0.9, "statement": "nothing is missing"},
            "gap": GAP,
            "effects": effects,
            "where": {"points": share, "frames": [1.0], "acts_on": share[::-1]},
            "sources": dict.fromkeys(("perception", "actuation", "parameters", "physics"), 0.0)
            | {"unexplained": 1.0},
        }
        (tmp_path / "report.json").write_text(json.dumps(content))
        return tmp_path

    return write


GAP = {
    "metric": "track_error_m",
    "baseline": 0.02,
    "refit": 0.01,
    "with_effect": None,
    "noise_floor": 0.01,
    "ceiling": 0.01,
    "closed_fraction": None,
    "closed_fraction_ci95": None,
    "heldout": [[0.0, 1.0]],
}


def test_points_of_the_twin_are_taken_as_they_are(report, twin):
    where = read_where(report(27), twin)
    assert where.gap.argmax() == 0
    assert where.effect.argmax() == 26


def test_other_points_need_the_observation(report, twin, tmp_path):
    folder = report(2)
    with pytest.raises(InputError, match=r"2 observed points, the twin has 27.*--observation"):
        read_where(folder, twin)
    path = seen(tmp_path, twin.topology.points[:9])
    with pytest.raises(InputError, match=r"seen\.npz: 9 points, report\.json has 2"):
        read_where(folder, twin, path)


def test_each_point_takes_what_is_observed_around_it(report, twin, tmp_path):
    near = (
        np.repeat(twin.topology.points[[3, 20]], 4, axis=0)
        + np.linspace(0, 1e-3, 8, dtype=np.float32)[:, None]
    )
    where = read_where(report(8), twin, seen(tmp_path, near))
    assert where.gap[3] == 1.0
    assert where.gap[20] == 0.0
    assert where.effect[20] > 0.0
    assert where.effect[3] == 0.0


def test_an_observation_that_lies_elsewhere_is_laid_on_the_twin_first(report, twin, tmp_path):
    """As the diagnosis does it, that the report is of."""
    folder, away = report(27), np.float32([1.0, 0.0, 0.0])
    there = read_where(folder, twin, seen(tmp_path, twin.topology.points))
    with pytest.warns(UserWarning, match="moved"):
        moved = read_where(folder, twin, seen(tmp_path, twin.topology.points + away))
    np.testing.assert_allclose(moved.gap, there.gap, atol=1e-6)


def test_no_report_is_refused(tmp_path, twin):
    with pytest.raises(InputError, match="cannot be read"):
        read_where(tmp_path, twin)
    (tmp_path / "report.json").write_text("{}")
    with pytest.raises(InputError, match=r"report\.json"):
        read_where(tmp_path / "report.json", twin)
