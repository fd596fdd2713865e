from dataclasses import replace

import pytest

from model.bundle import TwinBundle
from model.exports import exporter_of
from model.exports.base import Exporter
from model.schema import EffectRecord
from model.types import Parameter


class Springs(Exporter):
    name = "springs"
    expressed = frozenset({"quadratic_air_drag"})

    def __call__(self, twin, out):
        return []


def test_effects_that_a_format_lacks_are_told_once_each(twin_path):
    names = ("wind", "quadratic_air_drag", "wind", "damage")
    twin = replace(TwinBundle.load(twin_path), effects=tuple(EffectRecord(name=name) for name in names))
    losses = [line for line in Springs().losses(twin) if "the effect " in line]
    assert [line.split("the effect ")[1].split(":")[0] for line in losses] == ["wind", "damage"]


def test_zigzags_that_die_out_are_told(twin_path):
    twin = TwinBundle.load(twin_path)
    decay = {"bending_decay": Parameter(200.0, "1/s", "prior")}
    calm = replace(twin, parameters=replace(twin.parameters, globals={**twin.parameters.globals, **decay}))
    assert [line for line in Springs().losses(calm) if "no bending_decay" in line]


def test_points_that_pass_through_each_other_are_told(twin_path):
    """A clip's twin has self-contact; the file's programs move it by their own laws, without."""
    twin = TwinBundle.load(twin_path)
    meets = {"collision_distance": Parameter(0.004, "m", "prior")}
    folded = replace(twin, parameters=replace(twin.parameters, globals={**twin.parameters.globals, **meets}))
    for name in ("mujoco", "newton", "phystwin"):
        assert [line for line in exporter_of(name).losses(folded) if "no self-contact" in line]
    assert exporter_of("glb").losses(folded) == ()


@pytest.mark.parametrize("name", ["usd", "glb", "ply"])
def test_formats_that_show_the_twins_own_motion_lose_none_of_it(twin_path, name):
    twin = TwinBundle.load(twin_path)
    decay = {"bending_decay": Parameter(200.0, "1/s", "prior")}
    calm = replace(twin, parameters=replace(twin.parameters, globals={**twin.parameters.globals, **decay}))
    assert exporter_of(name).losses(replace(calm, effects=(EffectRecord(name="wind"),))) == ()


def test_a_twin_without_effects_and_self_contact_loses_nothing(twin_path):
    twin = TwinBundle.load(twin_path)
    apart = {**twin.parameters.globals, "collision_distance": Parameter(0.0, "m", "user")}
    assert Springs().losses(replace(twin, parameters=replace(twin.parameters, globals=apart))) == ()
