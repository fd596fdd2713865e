import builtins
from dataclasses import replace

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdValidation, UsdVol

from model.errors import InputError
from model.exports.mechanics import roll
from model.exports.usd import UsdExporter


def problems(stage):
    """What all validators of OpenUSD say."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    found = UsdValidation.ValidationContext(validators).Validate(stage)
    return [error.GetErrorAsString() for error in found]


@pytest.fixture
def stage(rope, tmp_path):
    UsdExporter()(rope, tmp_path / "rope.usdc")
    return Usd.Stage.Open(str(tmp_path / "rope.usdc"))


def test_the_validators_have_nothing_to_say(stage):
    assert problems(stage) == []


def test_the_validators_would_have_something_to_say(stage):
    stage.ClearDefaultPrim()
    stage.GetRootLayer().pseudoRoot.ClearInfo("upAxis")
    assert problems(stage)


def test_points_and_gaussians_move_as_the_twin_does(stage, rope):
    trajectory = roll(rope)
    points = UsdGeom.Points(stage.GetPrimAtPath("/Twin/Points")).GetPointsAttr()
    assert points.GetTimeSamples() == list(range(len(trajectory.times)))
    for time in (0, 9, 30):
        np.testing.assert_array_equal(points.Get(time), trajectory.points[time])
    field = UsdVol.ParticleField3DGaussianSplat(stage.GetPrimAtPath("/Twin/Gaussians"))
    # Each Gaussian of this twin sits on a point.
    np.testing.assert_allclose(field.GetPositionsAttr().Get(9), trajectory.points[9], atol=1e-5)
    turn = field.GetOrientationsAttr().Get(0)[0]
    np.testing.assert_allclose([turn.real, *turn.imaginary], [1, 0, 0, 0], atol=1e-4)
    turned = field.GetOrientationsAttr().Get(9)[3]
    assert abs(np.linalg.norm([turned.real, *turned.imaginary]) - 1) < 1e-5
    assert turned.real > 0.5


def test_gaussians_have_what_the_schema_asks_for(stage, rope):
    field, count = (
        UsdVol.ParticleField3DGaussianSplat(stage.GetPrimAtPath("/Twin/Gaussians")),
        len(rope.gaussians),
    )
    np.testing.assert_array_equal(field.GetScalesAttr().Get(), rope.gaussians.scales)
    np.testing.assert_array_equal(field.GetOpacitiesAttr().Get(), rope.gaussians.opacities)
    assert field.GetRadianceSphericalHarmonicsDegreeAttr().Get() == 0
    colors = 0.5 + 0.28209479177387814 * np.array(field.GetRadianceSphericalHarmonicsCoefficientsAttr().Get())
    np.testing.assert_allclose(colors, rope.gaussians.colors, atol=1e-6)
    assert len(field.GetPositionsAttr().Get(0)) == count


def test_harmonics_are_grouped_by_gaussian(rope, tmp_path):
    rest = np.arange(len(rope.gaussians) * 9, dtype=np.float32).reshape(-1, 9)
    gaussians = type(rope.gaussians)(**{**vars(rope.gaussians), "harmonics": rest})
    UsdExporter()(type(rope)(**{**vars(rope), "gaussians": gaussians}), tmp_path / "rope.usda")
    stage = Usd.Stage.Open(str(tmp_path / "rope.usda"))
    field = UsdVol.ParticleField3DGaussianSplat(stage.GetPrimAtPath("/Twin/Gaussians"))
    assert field.GetRadianceSphericalHarmonicsDegreeAttr().Get() == 1
    values = np.array(field.GetRadianceSphericalHarmonicsCoefficientsAttr().Get()).reshape(-1, 4, 3)
    # A 3DGS file has all of red, then green, then blue.
    np.testing.assert_array_equal(values[2, 1:, 0], rest[2, 0:3])
    np.testing.assert_array_equal(values[2, 1:, 2], rest[2, 6:9])
    assert problems(stage) == []


def test_springs_and_parameters_are_documented_primvars(stage, rope):
    springs = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/Twin/Springs"))
    np.testing.assert_array_equal(springs.GetPrimvar("stiffness").Get(), rope.parameters.stiffness)
    np.testing.assert_array_equal(springs.GetPrimvar("ends").Get(), rope.topology.springs)
    np.testing.assert_array_equal(springs.GetPrimvar("restLength").Get(), rope.topology.rest_length)
    points = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/Twin/Points"))
    np.testing.assert_array_equal(points.GetPrimvar("mass").Get(), rope.topology.mass)
    twin = UsdGeom.PrimvarsAPI(stage.GetPrimAtPath("/Twin"))
    assert twin.GetPrimvar("drag_rate").Get() == pytest.approx(1.5)
    assert twin.GetPrimvar("bending_decay").Get() == 0.0
    for primvar in [each for prim in (springs, points, twin) for each in prim.GetAuthoredPrimvars()]:
        assert primvar.GetPrimvarName() == "displayColor" or primvar.GetAttr().GetDocumentation()


@pytest.mark.parametrize("lacking", ["springs", "grips"])
def test_a_twin_without_some_springs_has_none_of_their_lines(rope, tmp_path, lacking):
    topology, parameters = rope.topology, rope.parameters
    none, pairs = np.zeros(0, np.float32), topology.springs[:0]
    if lacking == "springs":
        topology, parameters = (
            replace(topology, springs=pairs, rest_length=none),
            replace(parameters, stiffness=none),
        )
    else:
        topology = replace(topology, controller_springs=pairs, controller_rest_length=none)
        parameters = replace(parameters, controller_stiffness=none)
    UsdExporter()(replace(rope, topology=topology, parameters=parameters), tmp_path / "rope.usdc")
    stage = Usd.Stage.Open(str(tmp_path / "rope.usdc"))
    there = {name for name in ("Springs", "ControllerSprings") if stage.GetPrimAtPath(f"/Twin/{name}")}
    assert there == ({"ControllerSprings"} if lacking == "springs" else {"Springs"})
    assert problems(stage) == []


def test_its_readme_travels_inside_with_units_and_frame(stage):
    text = stage.GetRootLayer().documentation
    assert "cannot express" in text
    assert (UsdGeom.GetStageUpAxis(stage), UsdGeom.GetStageMetersPerUnit(stage)) == ("Z", 1.0)
    assert stage.GetTimeCodesPerSecond() == pytest.approx(30.0)


def test_another_suffix_is_refused(rope, tmp_path):
    with pytest.raises(InputError, match=r"ends in \.usdc"):
        UsdExporter()(rope, tmp_path / "rope.obj")


def test_without_the_package_it_says_what_to_install(rope, tmp_path, monkeypatch):
    real = builtins.__import__

    def missing(name, *rest, **options):
        if name.startswith("pxr"):
            raise ImportError(name)
        return real(name, *rest, **options)

    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(InputError, match=r"pip install 'matphys\[usd\]'"):
        UsdExporter()(rope, tmp_path / "rope.usdc")
