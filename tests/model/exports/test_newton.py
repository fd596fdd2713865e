import importlib.util

import numpy as np

from model.exports.newton import NewtonExporter


def test_the_model_that_its_script_builds_has_the_twins_numbers(sheet, tmp_path):
    NewtonExporter()(sheet, tmp_path)
    spec = importlib.util.spec_from_file_location("exported_run", tmp_path / "run.py")
    run = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(run)
    with np.load(tmp_path / "twin.npz") as file:
        model = run.build({name: file[name] for name in file.files})
    points, springs = len(sheet.topology.points), len(sheet.topology.springs)
    np.testing.assert_array_equal(model.particle_q.numpy()[:points], sheet.topology.points)
    np.testing.assert_array_equal(model.particle_mass.numpy()[:points], sheet.topology.mass)
    np.testing.assert_array_equal(model.spring_stiffness.numpy()[:springs], sheet.parameters.stiffness)
    np.testing.assert_array_equal(model.spring_rest_length.numpy()[:springs], sheet.topology.rest_length)
    assert model.spring_count == springs + len(sheet.topology.controller_springs)


def test_it_says_what_it_wrote_and_what_newton_lacks(sheet, tmp_path):
    written = NewtonExporter()(sheet, tmp_path)
    assert sorted(path.name for path in written) == ["README.md", "run.py", "twin.npz"]
    text = (tmp_path / "README.md").read_text()
    assert "no drag" in text
    assert "single precision" in text
    assert "dashpot_damping N·s/m" in text
