from dataclasses import replace
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from model.errors import InputError
from model.exports.mechanics import mechanics_of
from model.exports.mujoco import MujocoExporter
from model.types import Parameter


@pytest.fixture
def loaded(sheet, tmp_path):
    MujocoExporter()(sheet, tmp_path)
    return mujoco.MjModel.from_xml_path(str(tmp_path / "twin.xml"))


def test_it_loads_as_it_is_with_every_point_spring_and_controller(loaded, sheet):
    points, springs = len(sheet.topology.points), len(sheet.topology.springs)
    assert (loaded.nv, loaded.nmocap) == (3 * points, len(sheet.topology.controller_points))
    assert loaded.ntendon == springs + len(sheet.topology.controller_springs)
    np.testing.assert_allclose(loaded.body_mass.sum(), sheet.topology.mass.sum(dtype=float), rtol=1e-6)
    np.testing.assert_allclose(
        loaded.tendon_stiffness[:springs].ravel(), sheet.parameters.stiffness, rtol=1e-6
    )
    np.testing.assert_allclose(loaded.tendon_lengthspring[:springs, 0], sheet.topology.rest_length, rtol=1e-6)
    assert (loaded.tendon_damping == 0.02).all()


def test_drag_takes_the_share_of_the_speed_that_it_should(falling, tmp_path):
    """A free body keeps exp(-rate dt) of its momentum in a step, but for gravity."""
    MujocoExporter()(falling, tmp_path)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "twin.xml"))
    data = mujoco.MjData(model)
    model.opt.gravity[:] = 0
    data.qvel[:] = np.tile([0.3, 0.0, 0.1], model.nv // 3)
    mujoco.mj_step(model, data)
    speed = model.body_mass[1:] @ data.qvel[::3] / model.body_mass.sum()
    np.testing.assert_allclose(speed, 0.3 * np.exp(-1.5 * model.opt.timestep), rtol=1e-12)


def test_the_viewer_shows_points_in_their_colours_and_no_tendons(loaded, sheet):
    shown = loaded.geom_group <= 2
    assert shown.sum() == len(sheet.topology.points) + loaded.nmocap
    colors = loaded.geom_rgba[loaded.geom_group == 1][:, :3]
    np.testing.assert_allclose(colors, sheet.gaussians.colors, atol=1e-3)
    assert (loaded.tendon_group > 2).all()


def test_the_ground_is_a_plane_that_every_point_meets(falling, tmp_path):
    MujocoExporter()(falling, tmp_path)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "twin.xml"))
    assert model.npair == len(falling.topology.points)
    np.testing.assert_allclose(model.pair_friction[:, 0], 0.5)


def test_it_says_what_it_wrote_and_what_it_cannot_express(sheet, tmp_path):
    written = MujocoExporter()(sheet, tmp_path / "new")
    assert sorted(path.name for path in written) == ["README.md", "replay.npz", "replay.py", "twin.xml"]
    text = (tmp_path / "new" / "README.md").read_text()
    for needed in ("z up", "N/m", "cannot express", "mocap", f"{mechanics_of(sheet).step:.6g} s"):
        assert needed in text


def test_drag_beyond_all_numbers_stops_points(sheet, tmp_path):
    stuck = {**sheet.parameters.globals, "drag_rate": Parameter(1e7, "1/s", "user")}
    twin = replace(sheet, parameters=replace(sheet.parameters, globals=stuck))
    MujocoExporter()(twin, tmp_path)
    data = mujoco.MjData(mujoco.MjModel.from_xml_path(str(tmp_path / "twin.xml")))
    before = data.qpos.copy()
    mujoco.mj_step(data.model, data)
    np.testing.assert_allclose(data.qpos, before, atol=1e-9)


def test_names_of_a_twin_cannot_break_the_document(sheet, tmp_path):
    odd = sheet.manifest.model_copy(update={"id": '"><evil/>'})
    MujocoExporter()(type(sheet)(**{**vars(sheet), "manifest": odd}), tmp_path)
    assert ElementTree.parse(tmp_path / "twin.xml").getroot().get("model") == "___evil__"


def test_a_file_in_its_place_is_refused(sheet, tmp_path):
    (tmp_path / "file").write_text("mine")
    with pytest.raises(InputError, match="this format is a folder"):
        MujocoExporter()(sheet, tmp_path / "file")
    assert (tmp_path / "file").read_text() == "mine"
