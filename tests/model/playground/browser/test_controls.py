"""What stands beside the stage, used as a person would: real clicks in a real page."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from playwright.sync_api import expect

from model.bundle import TwinBundle
from model.playground.settings import settings_of
from model.priors.materials import MATERIALS, typical
from model.schema import PartRecord, PropertyRecord

pytestmark = pytest.mark.slow


@pytest.fixture
def told_twin(green_twin):
    """The green twin, which says what its two parts are made of."""
    bundle = TwinBundle.load(green_twin)
    chances = {name: float(name == "fabric") for name in MATERIALS}
    prior = {
        name: PropertyRecord(mean=belief.mean, spread=belief.spread, unit=belief.unit)
        for name, belief in typical("fabric", "solid").items()
    }
    labels = ("head", "body")
    parts = tuple(PartRecord(label=label, materials=chances, prior=prior) for label in labels)
    replace(bundle, parts=parts).save(green_twin)
    return green_twin


@pytest.fixture
def windy_twin(green_twin, effect):
    """The green twin in a strong wind, which a diagnosis is supposed to have found."""
    bundle = TwinBundle.load(green_twin)
    wind = effect("wind", drag_per_mass=3.0, x=3.0, y=0.0)
    replace(bundle, effects=(wind,)).save(green_twin)
    return green_twin


def test_every_slider_takes_effect(play, told_twin):
    page = play(told_twin)
    page.page.set_viewport_size({"width": 1000, "height": 1500})  # no control is half hidden
    before = page.session.moment.settings

    def slid(label, share, value):
        was = value(page.session.moment.settings)
        page.slide(label, share)
        page.wait(lambda: value(page.session.moment.settings) != was, f"{label} to take effect")
        return value(page.session.moment.settings)

    assert slid("Wind x m/s", 0.75, lambda s: s.wind[0]) == pytest.approx(4.0, abs=0.5)
    assert slid("Wind y m/s", 0.25, lambda s: s.wind[1]) == pytest.approx(-4.0, abs=0.5)
    assert slid("Air grip 1/m", 0.5, lambda s: s.air_grip) == pytest.approx(5.0, abs=0.5)
    assert slid("Friction", 0.9, lambda s: s.friction) == pytest.approx(1.8, abs=0.1)
    assert slid("Restitution", 0.75, lambda s: s.restitution) == pytest.approx(0.75, abs=0.05)
    assert slid("Ground height cm", 0.25, lambda s: s.ground_height) < before.ground_height - 0.02
    assert slid("head ×", 0.5, lambda s: s.stiffness[0]) == pytest.approx(5.0, abs=0.5)
    assert slid("body ×", 0.25, lambda s: s.stiffness[1]) == pytest.approx(2.6, abs=0.4)
    assert slid("Damping N·s/m", 0.5, lambda s: s.dashpot_damping) == pytest.approx(0.125, abs=0.02)
    assert slid("Drag 1/s", 0.5, lambda s: s.drag_rate) == pytest.approx(5.0, abs=0.5)
    page.named("Ground").click()
    page.wait(lambda: not page.session.moment.settings.ground, "the ground to go")
    page.named("Gravity m/s²").locator("xpath=ancestor::div[count(.//input)=3][1]//input").nth(2).fill("3")
    page.wait(lambda: page.session.moment.settings.gravity[2] == 3, "gravity to turn")
    page.button("Let the hand go").click()
    start = page.session.moment.points[0][:, 2].mean()
    page.wait(lambda: page.session.moment.points[0][:, 2].mean() > start + 0.2, "the object to fall upwards")

    with page.page.expect_download(timeout=120_000) as download:
        page.button("Save the edited twin").click()
    assert download.value.suggested_filename == "cube.edited.twin.zip"
    path = told_twin.with_name("again.twin.zip")
    download.value.save_as(path)
    saved, now = settings_of(TwinBundle.load(path)), page.session.moment.settings
    assert saved == replace(
        now, stiffness=saved.stiffness, ground_height=saved.ground_height
    )  # there is none
    factor = TwinBundle.load(path).parameters.stiffness / TwinBundle.load(told_twin).parameters.stiffness
    assert np.median(factor) > 2


def test_the_recorded_motion_is_played_coloured_and_filmed(play, told_twin):
    page = play(told_twin)
    for by, words in (
        ("part", "head"),
        ("material", "fabric"),
        ("stiffness", "N/m"),
        ("strain", "strain 0 %"),
    ):
        page.choose("Colour by", by)
        expect(page.page.get_by_text(words).first).to_be_visible()
        page.wait(lambda: page.seen() is None, f"the object in colours by {by}")
    page.choose("Colour by", "appearance")
    page.wait(lambda: page.seen() is not None, "the object as it looks")

    page.button("Record a video").click()
    page.wait(lambda: page.playground.recording.on, "the recording to begin")
    page.button("Play the recorded motion").click()
    controls, interval = TwinBundle.load(told_twin).controls, page.session.interval
    seconds = (len(controls) - 1) * interval
    page.wait(lambda: (page.session.moment.motion or 0) > seconds, "the motion to end")
    np.testing.assert_allclose(page.session.moment.hands[0], controls[-1], atol=1e-6)
    with page.page.expect_download(timeout=300_000) as download:
        page.page.get_by_role("button", name="Stop recording").click()
    path = told_twin.with_name("film.mp4")
    download.value.save_as(path)
    film = cv2.VideoCapture(str(path))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) >= seconds / interval
    _, picture = film.read()
    film.release()
    blue, green, red = (picture[..., channel].astype(int) for channel in range(3))
    assert ((green > red + 40) & (green > blue + 40)).sum() > 50


def test_a_part_is_made_of_another_material(play, told_twin):
    page = play(told_twin)
    before = page.session.bundle
    page.choose("Part", "1: body")
    page.choose("Made of", "rubber")
    page.button("Predict its springs").click()
    page.wait(lambda: page.session.moment.resets == 1, "the springs to be predicted")
    after = page.session.edited()
    inside = before.topology.part == 1
    assert after.parts[1].materials["rubber"] == 1
    assert after.topology.mass[inside].sum() > 1.5 * before.topology.mass[inside].sum()
    np.testing.assert_array_equal(after.topology.mass[~inside], before.topology.mass[~inside])
    expect(page.page.get_by_text("1: body: rubber")).to_be_visible()
    page.choose("Made of", "as it was")
    page.button("Predict its springs").click()
    page.wait(lambda: page.session.moment.resets == 2, "the part to be as it was")
    assert page.session.edited() is before


def test_with_and_without_an_effect_stand_side_by_side(play, windy_twin):
    page = play(windy_twin, compare=True)
    page.page.set_viewport_size({"width": 1400, "height": 700})
    without, blown = page.settled(), page.session.moment.points[1]
    assert blown[:, 0].mean() > without[:, 0].mean() + 0.01
    assert np.linalg.norm(page.session.actors[1].shift) > 0.05
    page.wait(lambda: len(page.blobs()) >= 2, "both to be shown, side by side")
