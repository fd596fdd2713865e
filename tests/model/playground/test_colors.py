from dataclasses import replace

import numpy as np
import pytest

from model.playground.colors import STRAINED, Colors, Where, material_of, on_points, strain
from model.playground.settings import settings_of
from model.schema import PartRecord


@pytest.fixture
def described(twin):
    parts = (
        PartRecord(label="head", materials={"rubber": 0.9, "fur": 0.1}),
        PartRecord(label="<b>body</b>", materials={"fur": 1.0}),
    )
    return replace(twin, parts=parts)


def test_a_twin_looks_as_it_looks(twin):
    colors = Colors(twin)("appearance", settings_of(twin), twin.topology.points)
    np.testing.assert_array_equal(colors, twin.gaussians.colors)
    bright = replace(twin, gaussians=replace(twin.gaussians, colors=3.0 * twin.gaussians.colors))
    assert Colors(bright)("appearance", settings_of(twin), twin.topology.points).max() == 1.0


@pytest.mark.parametrize("by", ["part", "material"])
def test_parts_and_materials_are_told_apart(described, by):
    colors = Colors(described)
    shown = colors(by, settings_of(described), described.topology.points)
    parts = described.topology.part
    for part in (0, 1):
        assert np.ptp(shown[parts == part], axis=0).max() < 1e-6
    assert np.abs(shown[parts == 0][0] - shown[parts == 1][0]).max() > 0.1
    words = [name for name, _ in colors.legend(by, settings_of(described))]
    assert words == (["head", "<b>body</b>"] if by == "part" else ["rubber", "fur"])
    assert material_of(described, 0) == "rubber"


def test_what_nobody_knows_is_grey(twin):
    shown = Colors(twin)("material", settings_of(twin), twin.topology.points)
    np.testing.assert_allclose(shown, 0.6)
    assert Colors(twin).legend("material", settings_of(twin)) == (("not known", (0.6, 0.6, 0.6)),)


def test_strain_is_that_of_the_springs(twin):
    assert strain(twin, twin.topology.points).max() < 1e-5
    stretched = (1.1 * twin.topology.points).astype(np.float32)
    np.testing.assert_allclose(strain(twin, stretched), 0.1, atol=1e-5)
    colors = Colors(twin)
    rest, pulled = (colors("strain", settings_of(twin), p) for p in (twin.topology.points, stretched))
    assert (pulled.sum(axis=1) > rest.sum(axis=1) + 0.3).all()
    assert f"{STRAINED:.0%}" in colors.legend("strain", settings_of(twin))[1][0]


def test_stiffer_points_are_brighter_and_follow_the_settings(twin):
    colors, settings = Colors(twin), settings_of(twin)
    shown = colors("stiffness", settings, twin.topology.points).sum(axis=1)
    mean = on_points(twin, np.log(twin.parameters.stiffness.astype(np.float64)))
    assert np.corrcoef(shown, mean)[0, 1] > 0.9
    stiffened = colors("stiffness", replace(settings, stiffness=(10.0, 0.1)), twin.topology.points).sum(
        axis=1
    )
    parts = twin.topology.part
    assert stiffened[parts == 0].mean() > stiffened[parts == 1].mean() + 0.5


def test_a_report_adds_two_choices(twin):
    count = len(twin.topology.points)
    where = Where(np.linspace(0, 1, count), np.linspace(1, 0, count))
    assert "gap" not in Colors(twin).choices
    colors = Colors(twin, where)
    assert {"gap", "effect"} <= set(colors.choices)
    for by, last_is_brighter in (("gap", True), ("effect", False)):
        shown = colors(by, settings_of(twin), twin.topology.points).sum(axis=1)
        assert (shown[-1] > shown[0]) == last_is_brighter


def test_every_choice_has_colours_between_0_and_1(described):
    count = len(described.topology.points)
    colors = Colors(described, Where(np.zeros(count), np.ones(count)))
    for by in colors.choices:
        shown = colors(by, settings_of(described), described.topology.points)
        assert shown.shape == (count, 3)
        assert 0 <= shown.min()
        assert shown.max() <= 1
        assert (colors.legend(by, settings_of(described)) == ()) == (by == "appearance")
