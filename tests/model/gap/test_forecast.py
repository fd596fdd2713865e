"""Free runs foretell what they have not seen, and nothing else does."""

from dataclasses import replace

import numpy as np
import pytest

from model.gap.closure import MEAN_DISTANCE
from model.gap.forecast import forecast, windows
from model.gap.observer import Observer
from model.simulator.divergence import SimulationDiverged

NOISE = 5e-4


@pytest.fixture
def sheet(hung, studied):
    return studied(hung, noise=NOISE)


def test_windows_cover_each_frame_once():
    times = np.arange(136) / 30.0
    starts = windows(times, 95)
    assert starts == [94, 114]
    assert windows(times[:40], 28) == [27]
    assert windows(times, 1)[0] == 0


def test_the_truth_is_off_by_the_noise_alone(sheet):
    found = forecast(sheet.observer, sheet.plain.at(sheet.base.values), sheet.split)
    assert found.points.shape == (12, 63, 3)
    assert found.error == pytest.approx(MEAN_DISTANCE * NOISE, rel=0.15)
    assert found.of_frames.mean() == pytest.approx(found.error, rel=1e-6)
    assert np.abs(found.innovations[0]).max() == 0.0
    stiffer = {**sheet.base.values, "stiffness": 5.0 * sheet.base.values["stiffness"]}
    assert forecast(sheet.observer, sheet.plain.at(stiffer), sheet.split).error > 2.0 * found.error


def test_a_free_run_sees_nothing_of_what_it_foretells(sheet):
    world = sheet.plain.at(sheet.base.values)
    points = sheet.observation.points.copy()
    points[sheet.split :] += 0.03
    points[sheet.split + 1, 3] = np.nan
    other = Observer(replace(sheet.observation, points=points), world, 0.3)
    before, after = (forecast(one, world, sheet.split) for one in (sheet.observer, other))
    np.testing.assert_array_equal(before.points, after.points)
    assert np.isnan(after.distance[1, 3])
    assert after.error == pytest.approx(0.03 * np.sqrt(3), rel=0.1)


def test_a_lost_run_is_off_by_what_is_lost(sheet, monkeypatch):
    world, lead = sheet.plain.at(sheet.base.values), Observer.lead

    def leaving(self, *arguments, until=None, **others):
        if until is not None:
            raise SimulationDiverged(3, 0, "spring", 10)
        return lead(self, *arguments, until=until, **others)

    monkeypatch.setattr(Observer, "lead", leaving)
    found = forecast(sheet.observer, world, sheet.split)
    assert found.error == pytest.approx(sheet.observer.lost)
    assert np.isfinite(found.innovations).all()


@pytest.mark.filterwarnings("ignore::model.simulator.pace.StabilityWarning")
def test_what_too_long_steps_lose_is_tried_in_finer_ones(sheet, monkeypatch):
    values = sheet.base.values
    world = sheet.plain.at({**values, "stiffness": 100.0 * values["stiffness"]})
    usual = forecast(sheet.observer, world, sheet.split)
    coarse = sheet.observer.substeps(world) // 3
    with pytest.raises(SimulationDiverged):
        sheet.observer.lead(world, substeps=coarse)
    monkeypatch.setattr(Observer, "substeps", lambda self, world, start=None: coarse)
    found = forecast(sheet.observer, world, sheet.split)
    assert found.error == pytest.approx(usual.error, rel=0.01)
