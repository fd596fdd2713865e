"""The playground, driven as a person would: real clicks and drags in a real page."""

import contextlib
import signal
import subprocess
import sys
import threading
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from model.playground.browser.server import open_playground

pytestmark = pytest.mark.slow


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


def test_an_interrupt_just_as_the_simulation_starts_leaves_no_thread_behind(
    green_twin, free_port, monkeypatch
):
    started, start = [], threading.Thread.start

    def interrupted(thread):
        start(thread)
        if thread.name == "playground":
            started.append(thread)
            raise KeyboardInterrupt

    playground = open_playground(green_twin, port=free_port)
    monkeypatch.setattr(threading.Thread, "start", interrupted)
    with pytest.raises(KeyboardInterrupt), contextlib.closing(playground):
        playground.run()
    (mover,) = started
    assert not mover.daemon
    mover.join(30)
    assert not mover.is_alive()


def test_the_command_serves_until_it_is_interrupted(green_twin, free_port):
    matphys = Path(sys.executable).parent / "matphys"
    command = [str(matphys), "view", str(green_twin), "--port", str(free_port)]
    # who started these tests in the background may have made them, and what they start, deaf to Ctrl-C
    heard = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    finally:
        signal.signal(signal.SIGINT, heard)
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
