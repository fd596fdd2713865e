import io

import av
import numpy as np
import pytest

from model.playground import movie
from model.playground.colors import Colors
from model.playground.movie import Recording, draw
from model.playground.session import Session
from model.rendering import SplatRenderer
from model.views import overview


def frames_of(data):
    with av.open(io.BytesIO(data)) as container:
        return np.stack([frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)])


def test_only_new_frames_are_kept_and_only_while_it_is_on(session):
    recording = Recording(session.interval)
    recording.see(session.step(), "appearance")
    assert len(recording) == 0
    recording.start()
    moment = session.step()
    recording.see(moment, "appearance")
    recording.see(moment, "appearance")
    recording.see(session.step(), "strain")
    assert recording.seconds == pytest.approx(2 / 30)
    assert [shot.by for shot in recording.stop()] == ["appearance", "strain"]
    assert not recording.on
    assert len(recording) == 0


def test_a_recording_has_an_end(session, monkeypatch):
    monkeypatch.setattr(movie, "LONGEST", 2.5 / 30)
    recording = Recording(session.interval)
    recording.start()
    for _ in range(6):
        recording.see(session.step(), "appearance")
    assert not recording.on
    assert len(recording) == 3


def test_the_video_shows_the_object_fall(plain_twin, steps):
    session, colors = Session(plain_twin), Colors(plain_twin)
    recording = Recording(session.interval)
    recording.start()
    session.free()
    for _ in range(3):
        recording.see(steps(session, 2), "part")
    shots = recording.stop()
    camera = overview(np.concatenate([shot.moment.points[0] for shot in shots]), 96, 64)
    pictures = frames_of(draw(shots, session.interval, session.actors, colors, camera, SplatRenderer()))
    assert pictures.shape == (3, 64, 96, 3)
    colorful = np.ptp(pictures.astype(int), axis=3) > 60
    rows = [np.nonzero(picture)[0].mean() for picture in colorful]
    assert rows[0] < rows[1] < rows[2]
