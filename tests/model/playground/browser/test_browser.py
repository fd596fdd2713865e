"""The playground, driven as a person would: real clicks and drags in a real page."""

import signal
import subprocess
import sys
import urllib.request
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from playwright.sync_api import expect

from model.bundle import TwinBundle

pytestmark = pytest.mark.slow

PATIENCE = 120.0
"""Seconds for a download."""


def middle(points):
    return points.astype(np.float64).mean(axis=0)


def test_the_object_follows_the_mouse(play):
    page = play()
    page.button("Let the hand go").click()
    points = page.settled()
    assert points[:, 2].min() == pytest.approx(0.1, abs=5e-3)
    start = page.seen_at(points)

    top = points[points[:, 2].argmax()]
    page.click(top)
    page.wait(lambda: page.session.moment.grips, "a control point")
    (grip,) = page.session.moment.grips
    page.wait(lambda: (grip.number, 0) in page.playground.scene.balls, "its ball")
    page.page.wait_for_timeout(500)

    page.drag(grip.place, (-90, -110))
    page.wait(lambda: page.session.moment.grips[0].dragged, "the drag to be heard")
    lifted = page.settled()
    followed = page.pixel(middle(lifted)) - page.pixel(middle(points))
    assert followed[1] < -50
    assert followed[0] < -40
    assert np.linalg.norm((page.seen_at(lifted) - start) - followed) < 25
    held = page.session.moment.grips[0]
    assert np.linalg.norm(page.pixel(held.place) - page.pixel(grip.place) - [-90, -110]) < 15

    page.page.mouse.up()
    page.wait(lambda: not page.session.moment.grips[0].holds, "the object to be let go")
    fallen = page.settled()
    assert middle(fallen)[2] < middle(lifted)[2] - 0.02
    assert page.seen_at(fallen)[1] > page.pixel(middle(lifted))[1] + 10


def test_a_click_pins_a_control_point_and_one_with_shift_removes_it(play):
    page = play()
    points = page.settled()
    page.click(points[points[:, 2].argmax()])
    page.wait(lambda: page.session.moment.grips, "a control point")
    page.page.wait_for_timeout(700)
    page.click(page.session.moment.grips[0].place)
    page.wait(lambda: page.session.moment.grips[0].pinned, "the pin")
    page.button("Let the hand go").click()
    page.wait(lambda: not page.session.moment.hand, "the hand to let go")
    hanging = page.settled()
    assert hanging[:, 2].max() > 0.2
    page.page.keyboard.down("Shift")
    page.click(page.session.moment.grips[0].place)
    page.page.keyboard.up("Shift")
    page.wait(lambda: not page.session.moment.grips, "the control point to go")
    assert page.settled()[:, 2].max() < 0.2


def test_what_is_set_beside_the_stage_is_seen_recorded_and_saved(play, tmp_path):
    play = play()
    page, session = play.page, play.session
    page.locator("input[value=appearance]:visible").click()
    page.get_by_role("option", name="part").click()
    expect(page.get_by_text("part 1").first).to_be_visible()
    play.wait(lambda: play.seen() is None, "the green to go")

    field = page.locator("input[value='0.4']:visible")
    field.fill("1.5")
    field.press("Enter")
    play.wait(lambda: session.moment.settings.friction == 1.5, "the friction")

    play.button("Record a video").click()
    stop = page.get_by_role("button", name="Stop recording")
    expect(stop).to_be_visible()
    page.wait_for_timeout(1500)
    with page.expect_download(timeout=1000 * PATIENCE) as caught:
        stop.click()
    caught.value.save_as(tmp_path / "seen.mp4")
    with av.open(str(tmp_path / "seen.mp4")) as film:
        pictures = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert len(pictures) > 3
    assert max(pictures[0].shape) == 640

    with page.expect_download(timeout=1000 * PATIENCE) as caught:
        play.button("Save the edited twin").click()
    assert caught.value.suggested_filename == "cube.edited.twin.zip"
    caught.value.save_as(tmp_path / "edited.twin.zip")
    saved = TwinBundle.load(tmp_path / "edited.twin.zip").parameters.globals["friction"]
    assert (saved.value, saved.source) == (1.5, "user")


def test_a_comparison_shows_both_side_by_side(play, green_twin, effect, tmp_path):
    twin = TwinBundle.load(green_twin)
    blown = replace(twin, effects=(effect("wind", drag_per_mass=2.0, x=3.0, y=0.0),))
    blown.save(tmp_path / "blown.twin.zip")
    play = play(tmp_path / "blown.twin.zip", compare=True)
    play.settled()
    without, with_ = (
        middle(points) + actor.shift
        for points, actor in zip(play.session.moment.points, play.session.actors, strict=True)
    )
    play.seen_at(np.stack([without, with_]))
    assert play.pixel(with_)[0] > play.pixel(without)[0] + 50


def test_the_command_serves_until_it_is_interrupted(green_twin, free_port):
    matphys = Path(sys.executable).parent / "matphys"
    command = [str(matphys), "view", str(green_twin), "--port", str(free_port)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == f"http://127.0.0.1:{free_port} (end with Ctrl-C)\n"
        with urllib.request.urlopen(f"http://127.0.0.1:{free_port}/", timeout=30) as page:
            assert page.status == 200
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0
    finally:
        process.kill()
        process.wait()
        rest = process.stdout.read()
        process.stdout.close()
    assert rest == ""
