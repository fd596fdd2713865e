import numpy as np
import pytest

from model.scenes.looks.base import Finish
from model.scenes.looks.light import Light, lit
from model.scenes.looks.paint import ALL_LOOKS

ABOVE = Light((0.0, 0.0, 1.0), 0.5, 0.5, (1.0, 1.0, 1.0))
MATT = Finish(specular=0.0, gloss=0.0)


def shade(normal, finish=MATT, view=(0.0, 0.0, 1.0), height=1.0, albedo=(0.5, 0.5, 0.5), light=ABOVE):
    rows = [np.array([value], np.float32) for value in (albedo, normal, view)]
    return lit(*rows, np.array([height]), (finish,), np.zeros(1, int), light)[0]


def test_what_faces_the_lamp_is_brightest_and_the_foot_is_darkest():
    up, aside, down = (shade(normal)[0] for normal in ((0, 0, 1), (1, 0, 0), (0, 0, -1)))
    assert up > aside > down > 0
    assert shade((0, 0, -1), height=0.0)[0] < 0.6 * down


def test_gloss_mirrors_the_lamp_where_a_mirror_would():
    shiny = Finish(specular=0.5, gloss=0.95)
    lamp, beside = shade((0, 0, 1), shiny), shade((0.5, 0, np.sqrt(0.75)), shiny)
    assert lamp[0] - shade((0, 0, 1))[0] > 0.3
    gain = [lamp[0] - shade((0, 0, 1))[0], beside[0] - shade((0.5, 0, np.sqrt(0.75)))[0]]
    assert gain[1] < 0.75 * gain[0]  # there it mirrors the room
    dull = Finish(specular=0.5, gloss=0.1)
    assert shade((0, 0, 1), dull)[0] < lamp[0]


def test_metal_reflects_in_its_own_colour_and_plastic_in_the_lamps():
    brass = (0.8, 0.6, 0.2)
    metal = shade((0, 0, 1), Finish(0.5, 0.9, metallic=True), albedo=brass)
    plastic = shade((0, 0, 1), Finish(0.5, 0.9), albedo=brass)
    assert metal[2] / metal[0] == pytest.approx(0.25, abs=0.02)
    assert plastic[2] / plastic[0] > 0.4


def test_fibres_glow_at_the_edge_and_soft_things_have_soft_shadows():
    edge = (1.0, 0.0, 0.05)
    assert shade((0, 0, 1), Finish(0.0, 0.0, sheen=0.5), view=edge)[0] > shade((0, 0, 1), view=edge)[0] + 0.05
    assert shade((1, 0, 0), Finish(0.0, 0.0, wrap=0.4))[0] > shade((1, 0, 0))[0] + 0.03


def test_lamps_stand_above_and_differ():
    lights = [Light.draw(np.random.default_rng(seed)) for seed in range(20)]
    for light in lights:
        assert np.linalg.norm(light.towards) == pytest.approx(1)
        assert light.towards[2] > 0.5
    assert len({light.towards for light in lights}) == 20


def test_all_finishes_stay_within_what_a_picture_holds():
    rng = np.random.default_rng(0)
    normals, views = (
        rows / np.linalg.norm(rows, axis=1, keepdims=True) for rows in rng.normal(size=(2, 500, 3))
    )
    for look in ALL_LOOKS:
        label = np.zeros(500, int)
        colors = lit(rng.uniform(0, 1, (500, 3)), normals, views, np.ones(500), (look.finish,), label, ABOVE)
        assert colors.min() >= 0
        assert colors.max() <= 1
