import pytest

from model import video as model_video
from worker.inspection import video
from worker.inspection.verdict import BrokenFileError


def test_the_limits_are_those_of_the_pipeline():
    assert video.CONTAINERS == model_video.CONTAINERS
    assert video.MAX_PIXELS == model_video.MAX_PIXELS
    assert video.MAX_SECONDS == model_video.MAX_SECONDS


def test_every_container_has_a_suffix():
    assert {
        name.partition(",")[0] for name in ("mov,mp4", "matroska,webm", "avi", "mpegts", "mpeg", "flv")
    } == set(video.SUFFIXES)


@pytest.mark.parametrize(
    ("container", "suffix"), [("mp4", ".mp4"), ("matroska", ".mkv"), ("avi", ".avi"), ("mpegts", ".ts")]
)
def test_a_clip_is_told_by_its_content(tmp_path, film, container, suffix):
    path = tmp_path / "upload"
    path.write_bytes(film(container=container))
    assert video.inspect(path) == suffix


def test_what_is_looked_at_is_also_read_by_the_pipeline(tmp_path, film):
    path = tmp_path / "upload.mkv"
    path.write_bytes(film(container="matroska"))
    video.inspect(path)
    assert len(model_video.read_video(path).images) == 6


def test_a_clip_that_is_too_long_by_its_pictures_is_refused_whatever_its_header_says(
    tmp_path, film, monkeypatch
):
    path = tmp_path / "upload"
    path.write_bytes(film(frames=30))
    monkeypatch.setattr(video, "MAX_SECONDS", 0.5)
    with pytest.raises(BrokenFileError, match=r"longer than 0\.5 s"):
        video.inspect(path)
    monkeypatch.setattr(video, "MAX_SECONDS", 60.0)
    monkeypatch.setattr(video, "MAX_PACKETS", 10)
    with pytest.raises(BrokenFileError, match="longer than"):
        video.inspect(path)
