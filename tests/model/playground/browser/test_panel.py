from dataclasses import replace

import pytest

from model.playground.browser.panel import legend_html, record_label, state_html, state_lines
from model.playground.movie import Recording


@pytest.mark.parametrize(
    ("speed", "said"),
    [(1.0, "real time"), (0.42, "0.42 × real time: slower than real time"), (None, "starting")],
)
def test_how_fast_time_passes_is_said(session, speed, said):
    assert state_lines(replace(session.moment, speed=speed)) == [said]


def test_what_the_user_should_know_is_said(session):
    moment = replace(session.moment, running=False, motion=1.25, idle=("grip_slip",), message="it broke")
    text = state_html(state_lines(replace(moment, building=True), "drawing the video: 9 frames"))
    for words in ("paused", "1.2 s", "grip_slip", "it broke", "making the simulator", "9 frames"):
        assert words in text


def test_the_button_of_the_video_says_what_it_does_next(session):
    recording = Recording(0.5)
    assert record_label(recording) == "Record a video"
    recording.start()
    recording.see(session.step(), "part")
    recording.see(session.step(), "part")
    assert record_label(recording) == "Stop recording (1 s)"
    recording.on = False
    assert record_label(recording) == "Draw the recording (1 s)"
    recording.stop()
    assert record_label(recording) == "Record a video"


def test_what_is_said_is_as_high_however_much_it_is_and_no_markup():
    short, long = state_html(["paused"]), state_html(["paused", *["<i>words</i>"] * 9])
    assert short.split(";")[0] == long.split(";")[0] != ""
    assert "height:" in short.split(";")[0]
    assert "<i>" not in long


def test_words_of_a_bundle_are_no_markup():
    shown = legend_html((("<b>body</b>", (1.0, 0.5, 0.0)),))
    assert "<b>" not in shown
    assert "&lt;b&gt;body" in shown
    assert "rgb(255,128,0)" in shown
