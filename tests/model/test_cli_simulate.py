"""`matphys simulate`, as a user would call it."""

import json
from pathlib import Path

import numpy as np
import pytest


@pytest.fixture
def twin_path(write_twin, tensors) -> Path:
    """Soft and heavy, so that few substeps are enough."""
    return write_twin(stiffness=tensors["stiffness"] / 10, mass=tensors["mass"] * 4)


@pytest.fixture
def simulate(run):
    """Run the command and read what it wrote: `simulate(twin, …)`."""

    def call(twin: Path, *more: object):
        out = twin.parent / "trajectory.npz"
        outcome = run("simulate", twin, "--out", out, "--substeps", 12, *more)
        assert outcome.code == 0, outcome.stderr
        with np.load(out) as arrays:
            return outcome, dict(arrays)

    return call


def test_recorded_controls(simulate, twin_path: Path, tensors):
    outcome, arrays = simulate(twin_path)
    assert set(arrays) == {"times", "points"}
    assert arrays["times"].dtype == np.float64
    assert arrays["points"].dtype == np.float32
    np.testing.assert_allclose(arrays["times"], np.arange(5) / 30)
    np.testing.assert_array_equal(arrays["points"][0], tensors["points"])
    assert arrays["points"].shape == (5, 27, 3)
    assert np.abs(arrays["points"][-1] - arrays["points"][0]).max() > 0.01
    assert "wrote" in outcome.stdout
    assert "5 frames of 27 points" in outcome.stdout


def test_it_is_repeatable_to_the_byte(simulate, twin_path: Path):
    simulate(twin_path)
    first = (twin_path.parent / "trajectory.npz").read_bytes()
    simulate(twin_path)
    assert (twin_path.parent / "trajectory.npz").read_bytes() == first


@pytest.mark.parametrize("key", ["controls", "controllers"])
def test_other_controls(simulate, twin_path: Path, tensors, key: str):
    path = twin_path.parent / "controls.npz"
    motion = tensors["controls"][:1].repeat(4, axis=0) + np.linspace(0, 0.05, 4)[:, None, None]
    np.savez(path, **{key: motion, "times": np.array([0, 0.02, 0.05, 0.06])})
    outcome, arrays = simulate(twin_path, "--controls", path)
    np.testing.assert_allclose(arrays["times"], [0, 0.02, 0.05, 0.06])
    assert arrays["points"].shape == (4, 27, 3)
    assert "from where the controllers" not in outcome.stderr


def test_times_may_begin_anywhere(simulate, twin_path: Path, tensors):
    path = twin_path.parent / "controls.npz"
    np.savez(path, controls=tensors["controls"][:4], times=np.array([100, 100.02, 100.05, 100.06]))
    outcome, arrays = simulate(twin_path, "--controls", path)
    assert "4 frames of 27 points, 0.06 s)" in outcome.stdout
    assert arrays["times"][0] == 100
    outcome, _ = simulate(twin_path, "--controls", path, "--json")
    assert json.loads(outcome.stdout)["seconds"] == pytest.approx(0.06)


def test_controls_that_hold_nothing_are_said(simulate, write_twin, tensors):
    names = ["controller_springs", "controller_rest_length", "controller_stiffness"]
    twin_path = write_twin(**{name: tensors[name][:0] for name in names})
    np.savez(twin_path.parent / "controls.npz", controls=tensors["controls"])
    outcome, _ = simulate(twin_path, "--controls", twin_path.parent / "controls.npz")
    assert (
        "warning: controls.npz moves nothing: no spring joins the controllers of this twin" in outcome.stderr
    )
    outcome, _ = simulate(twin_path)
    assert "moves nothing" not in outcome.stderr


def test_a_jump_is_said(simulate, twin_path: Path, tensors):
    np.savez(twin_path.parent / "controls.npz", controls=tensors["controls"] + 0.05)
    outcome, _ = simulate(twin_path, "--controls", twin_path.parent / "controls.npz")
    assert "warning: controls.npz starts 0.05 m from where" in outcome.stderr


def test_too_few_substeps_are_said(simulate, twin_path: Path):
    outcome, _ = simulate(twin_path, "--substeps", 2)
    assert "warning: 2 substeps per frame" in outcome.stderr


def test_without_controllers(simulate, write_twin):
    names = ["controls", "controller_points", "controller_springs"]
    names += ["controller_rest_length", "controller_stiffness"]
    _, arrays = simulate(write_twin(**dict.fromkeys(names)))
    fall = 9.81 / 2 * (4 / 30) ** 2
    drop = (arrays["points"][0] - arrays["points"][-1]).mean(axis=0)
    np.testing.assert_allclose(drop, [0, 0, fall], atol=0.12 * fall)


def test_held_still_without_controls(simulate, write_twin):
    _, arrays = simulate(write_twin(controls=None))
    assert arrays["points"].shape == (5, 27, 3)


def test_json(simulate, twin_path: Path):
    outcome, _ = simulate(twin_path, "--json")
    result = json.loads(outcome.stdout)
    assert result["frames"] == 5
    assert result["points"] == 27
    assert result["substeps_per_frame"] == 12


def test_a_broken_twin(run, twin_path: Path):
    twin_path.write_bytes(b"PK\x03\x04")
    outcome = run("simulate", twin_path, "--out", twin_path.parent / "o.npz")
    assert outcome.code == 2
    assert "expected a zip archive" in outcome.line
    assert not (twin_path.parent / "o.npz").exists()


def test_no_frame_rate(run, write_twin):
    path = write_twin(files={"twin.json": b'{"schema": "matphys.twin/1"}'})
    outcome = run("simulate", path, "--out", path.parent / "o.npz", "--quiet")
    assert outcome.code == 2
    assert "source.fps is missing" in outcome.line


def test_an_effect_is_not_dropped_in_silence(run, write_twin):
    path = write_twin(files={"effects.json": b'[{"name": "wind"}]'})
    outcome = run("simulate", path, "--out", path.parent / "o.npz", "--quiet")
    assert outcome.code == 2
    assert "effects.json: 0: wind: drag_per_mass is missing" in outcome.line


def test_an_effect_moves_the_twin(run, write_twin):
    wind = {
        "name": "wind",
        "parameters": {"drag_per_mass": 2.0, "x": 0.0, "y": {"value": 5.0, "unit": "m/s"}},
    }
    blown = write_twin("blown.twin.zip", files={"effects.json": json.dumps([wind]).encode()})
    ends = []
    for path in (write_twin(), blown):
        assert run("simulate", path, "--out", path.parent / "o.npz", "--quiet", "--substeps", 60).code == 0
        ends.append(np.load(path.parent / "o.npz")["points"][-1])
    assert (ends[1] - ends[0])[:, 1].mean() > 1e-3
