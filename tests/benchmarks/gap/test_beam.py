"""The twin of a beam against the closed form of one, and what the command makes of its files."""

import numpy as np
import pytest

from benchmarks.gap import beam
from benchmarks.gap.beam_figure import tip
from benchmarks.gap.beam_twin import added, elsewhere, foretold, lengthwise, load_found, per_metre, with_load
from benchmarks.gap.cantilever import GRAVITY, Cantilever
from benchmarks.gap.swing import swing
from model.gap.study import study

LOAD = 0.052
PER_METRE = 0.963
"""Of the beam [kg/m]."""


def swung(observation, points=None):
    places = observation.points.astype(np.float64) if points is None else points
    return swing(observation.times, places[..., 2].mean(1))


@pytest.fixture(scope="module")
def fitted():
    """To a second of the beam without a load."""
    return study(Cantilever().recording(1.0))


@pytest.mark.parametrize("load", [0.0, LOAD])
def test_a_swing_is_measured_as_the_closed_form_has_it(load):
    made = Cantilever(load=load)
    found = swung(made.recording(4.0))
    assert found.drop == pytest.approx(made.drop, rel=0.01)
    assert found.period == pytest.approx(made.period / np.sqrt(1 - 0.05**2), rel=1e-3)
    assert found.damping == pytest.approx(0.05, rel=1e-2)


def test_the_closed_form_is_what_the_data_say_of_the_real_beam():
    """6.6 and 16.2 mm with 264 kPa; 0.13 and 0.23 s were measured."""
    bare, loaded = Cantilever(), Cantilever(load=LOAD)
    assert (bare.drop, loaded.drop) == (pytest.approx(6.6e-3, abs=5e-5), pytest.approx(16.2e-3, abs=5e-5))
    assert (bare.period, loaded.period) == (pytest.approx(0.13, abs=3e-3), pytest.approx(0.23, abs=8e-3))


def test_the_fitted_twin_drops_and_swings_as_the_closed_form(fitted):
    made = Cantilever()
    found = swung(fitted.observation, foretold(fitted, fitted.plain.twin))
    assert found.drop == pytest.approx(made.drop, rel=0.15)
    assert found.period == pytest.approx(made.period, rel=0.08)
    assert fitted.base.values["prestress"] < 0.1, "it is not at rest where it was held"


def test_what_a_load_does_is_foretold(fitted):
    made = Cantilever(load=LOAD)
    there = elsewhere(fitted, made.recording(4.0))  # until it is at rest: a drop is told from its end
    bare = swung(there.observation, foretold(fitted, there))
    loaded = swung(there.observation, foretold(fitted, there, LOAD / PER_METRE))
    assert bare.period == pytest.approx(Cantilever().period, rel=0.08)
    assert loaded.drop == pytest.approx(made.drop, rel=0.1)
    assert loaded.period == pytest.approx(made.period, rel=0.05)


def test_a_load_hangs_at_the_free_end(fitted):
    twin = fitted.plain.twin
    more = with_load(twin, 0.05).matter.mass - twin.matter.mass
    assert more.sum() == pytest.approx(0.05 * per_metre(twin))
    assert lengthwise(twin)[more > 0].min() == pytest.approx(lengthwise(twin).max(), abs=4e-3)
    values = {"excess": 1.0, "x": 0.5, "y": 0.5, "z": 0.5, "radius": 0.5}
    load, where = added(twin, {f"mass_heterogeneity.{name}": value for name, value in values.items()})
    assert 0.0 < load < 0.2
    assert where == pytest.approx(0.5, abs=0.1)


def test_the_load_that_fits_is_about_what_hangs_there(fitted):
    there = elsewhere(fitted, Cantilever(load=LOAD).recording(0.6))
    assert PER_METRE * load_found(fitted, there) == pytest.approx(LOAD, rel=0.4)
    assert PER_METRE * load_found(fitted, fitted.plain.twin) < 0.15 * LOAD


def write(folder, name, load=0.0):
    seen = Cantilever(load=load).recording(0.8, held=0.2)
    about = {"tip_load_N": load * GRAVITY, "density": 1070.0, "beam_size_m": [0.1, 0.03, 0.03]}
    noise = np.random.default_rng(len(name)).normal(0, 1e-5, seen.points.shape)
    np.savez(
        folder / f"{name}.npz",
        times=seen.times,
        points=seen.points + noise,
        controllers=seen.controllers,
        release_frame=20,
        **about,
    )


def test_files_are_read_from_when_the_beam_is_let_go(tmp_path):
    write(tmp_path, "loaded", LOAD)
    found = beam.Recording.read(tmp_path / "loaded.npz")
    assert found.left_out == 20
    assert found.per_metre * found.load == pytest.approx(LOAD)
    assert found.per_metre == pytest.approx(PER_METRE)
    line = tip(found.seen.times, found.places)
    assert line.times[0] == line.height[0] == 0.0
    assert beam.row("seen", found).swing.period == pytest.approx(Cantilever(load=LOAD).period, rel=0.01)
    shaken = found.seen.controllers + np.linspace(0, 1e-3, len(found.seen.times))[:, None, None]
    moved = beam.Recording(found.seen, 0, 0.0, 1.0)
    object.__setattr__(moved.seen, "controllers", shaken.astype(np.float32))
    assert np.ptp(moved.at_rest().seen.controllers, axis=0).max() == 0.0


def test_errors_are_of_the_first_second_and_from_where_it_was_let_go():
    times = np.arange(300) / 100.0
    seen = np.zeros((300, 3, 3))
    other = np.full((300, 3, 3), 0.5)
    other[1:100] += [0.0, 0.003, 0.004]
    other[120:] += 1.0
    assert beam.error(seen, other, times) == pytest.approx(0.99 * 0.005)


def test_absent_data_are_said_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("MATPHYS_DATA", str(tmp_path))
    assert beam.main(["--out", str(tmp_path / "out")]) == 2
    assert "MATPHYS_DATA" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
