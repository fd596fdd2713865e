from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from model.errors import InputError
from model.frame_keeper import WORKING_SIDE
from model.video import probe_video, read_video

CORNERS = np.zeros((48, 64, 3), np.uint8)
CORNERS[:24, :32] = 255
CORNERS[:24, 32:] = (255, 0, 0)


def write_clip(path: Path, images, *, rate=30, times=None, codec="libx264", rotation=0, options=None):
    """Encode RGB images; `times` [s] overrides the constant rate."""
    container_options = {"movflags": "faststart"} if path.suffix == ".mp4" else {}
    with av.open(str(path), "w", options=container_options) as container:
        stream = container.add_stream(codec, rate=rate, options=options or {})
        stream.height, stream.width = images[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        tick = Fraction(1, rate) if path.suffix == ".avi" else Fraction(1, 1000)
        stream.time_base = stream.codec_context.time_base = tick
        if rotation:
            stream.set_display_rotation(rotation)
        for index, image in enumerate(images):
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.time_base = tick
            frame.pts = round((index / rate if times is None else times[index]) / tick)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def moving(count, height=48, width=64):
    images = np.full((count, height, width, 3), 40, np.uint8)
    for index, image in enumerate(images):
        image[8:24, 2 + index % 40 : 18 + index % 40] = 220
    return images


def test_reads_every_frame_with_its_time(tmp_path):
    frames = read_video(write_clip(tmp_path / "a.mp4", moving(12), rate=25))
    assert frames.images.shape == (12, 48, 64, 3)
    np.testing.assert_allclose(frames.times, np.arange(12) / 25, atol=1e-3)
    assert frames.name == "a.mp4"
    assert len(frames.sha256) == 64
    assert frames.source_size is None
    assert abs(int(frames.images[3, 15, 10].mean()) - 220) < 12


@pytest.mark.parametrize("suffix", [".mkv", ".mov", ".webm", ".avi"])
def test_other_containers(tmp_path, suffix):
    codec = {".webm": "libvpx", ".avi": "mpeg4"}.get(suffix, "libx264")
    path = tmp_path / f"a{suffix}"
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=30)
        stream.height, stream.width, stream.pix_fmt = 48, 64, "yuv420p"
        for image in moving(10):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode())
    frames = read_video(path)
    assert len(frames.images) == 10
    assert frames.fps == pytest.approx(30, rel=0.05)


def test_variable_frame_rate_keeps_its_times(tmp_path):
    times = [0.5, 0.52, 0.6, 0.9, 0.95, 1.4]
    frames = read_video(write_clip(tmp_path / "a.mp4", moving(6), times=times))
    np.testing.assert_allclose(frames.times, np.array(times) - 0.5, atol=2e-3)


@pytest.mark.parametrize("rotation", [90, 180, -90])
def test_rotation_metadata_is_honoured(tmp_path, rotation):
    frames = read_video(write_clip(tmp_path / "a.mp4", [CORNERS] * 3, rotation=rotation))
    # PyAV's angle is counterclockwise, as numpy's.
    expected = np.rot90(CORNERS, rotation // 90)
    assert frames.images[0].shape == expected.shape
    assert np.abs(frames.images[0].astype(int) - expected).mean() < 12


def test_large_frames_are_reduced_to_the_working_size(tmp_path):
    path = write_clip(tmp_path / "a.mp4", moving(3, 1080, 1920), options={"preset": "ultrafast"})
    frames = read_video(path)
    assert max(frames.images.shape[1:3]) == WORKING_SIDE
    assert frames.images.shape[1:3] == (540, 960)
    assert frames.source_size == (1920, 1080)


def test_too_many_frames_are_thinned_evenly_with_a_warning(tmp_path):
    frames = read_video(write_clip(tmp_path / "a.mp4", moving(25)), max_frames=10)
    assert len(frames.images) == 9
    np.testing.assert_allclose(np.diff(frames.times), 0.1, atol=2e-3)
    assert "25 frames" in frames.warnings[0]
    assert [frames.number(index) for index in range(9)] == list(range(0, 25, 3))
    assert (frames.length, frames.index(13), frames.index(24)) == (25, 4, 8)


def test_frames_are_numbered_as_in_the_clip_where_one_repeats_a_time(tmp_path):
    frames = read_video(write_clip(tmp_path / "a.mkv", moving(6), times=[0, 0.1, 0.1004, 0.2, 0.3, 0.4]))
    assert len(frames.images) == 5
    assert [frames.number(index) for index in range(5)] == [0, 1, 3, 4, 5]
    assert frames.length == 6


def test_a_nominal_rate_of_a_thousand_costs_no_frames(tmp_path):
    times = [index / 10 for index in range(20)]
    frames = read_video(write_clip(tmp_path / "a.mkv", moving(20), rate=1000, times=times), max_frames=30)
    assert len(frames.images) == 20
    assert frames.warnings == ()


def test_frames_that_an_avi_shows_for_longer_cost_none(tmp_path):
    times = [index / 10 for index in range(20)]
    clip = write_clip(tmp_path / "a.avi", moving(20), rate=200, times=times, codec="mpeg4")
    frames = read_video(clip, max_frames=30)
    assert len(frames.images) == 20
    assert frames.warnings == ()


def test_probe_reads_the_header(tmp_path):
    info = probe_video(write_clip(tmp_path / "a.mp4", moving(12), rate=24))
    assert (info.width, info.height, info.frame_count, info.codec) == (64, 48, 12, "h264")
    assert info.fps == pytest.approx(24, rel=0.02)
    assert info.duration == pytest.approx(0.5, rel=0.1)


def refused(path, **limits):
    with pytest.raises(InputError) as caught:
        read_video(path, **limits)
    message = str(caught.value)
    assert "\n" not in message
    assert path.name in message
    return message


def test_bad_files_are_refused_in_one_line(tmp_path, capfd):
    assert "no such file" in refused(tmp_path / "none.mp4")
    (tmp_path / "empty.mp4").write_bytes(b"")
    assert "empty" in refused(tmp_path / "empty.mp4")
    (tmp_path / "text.mp4").write_text("this is no video\n" * 50)
    assert "not a readable video" in refused(tmp_path / "text.mp4")
    assert "at least 2" in refused(write_clip(tmp_path / "one.mp4", moving(1)))
    assert capfd.readouterr() == ("", "")


def test_playlists_and_pictures_are_refused(tmp_path):
    clip = write_clip(tmp_path / "a.mp4", moving(5))
    (tmp_path / "list.mp4").write_text(f"ffconcat version 1.0\nfile {clip.name}\n")
    assert "not a readable video" in refused(tmp_path / "list.mp4")
    (tmp_path / "hls.mp4").write_text(
        f"#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n{clip.name}\n#EXT-X-ENDLIST\n"
    )
    assert "not a readable video" in refused(tmp_path / "hls.mp4")
    cv2.imwrite(str(tmp_path / "picture.png"), CORNERS)
    assert "not a readable video" in refused(tmp_path / "picture.png")


def test_a_sound_file_holds_no_video(tmp_path):
    path = tmp_path / "sound.mp4"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("aac", rate=44100, layout="mono")
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 4096), np.float32), format="fltp", layout="mono")
        frame.sample_rate = 44100
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    assert "no video stream" in refused(path)


@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".avi"])
def test_a_truncated_clip_says_where_it_breaks_off(tmp_path, suffix, capfd):
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 255, (20, 48, 64, 3), dtype=np.uint8)
    path = write_clip(tmp_path / f"a{suffix}", noise, codec="mpeg4" if suffix == ".avi" else "libx264")
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 6 // 10])
    assert "breaks off after frame" in refused(path)
    assert capfd.readouterr() == ("", "")


def test_a_clip_without_its_header_is_refused(tmp_path):
    path = tmp_path / "a.mp4"
    with av.open(str(path), "w") as container:  # without faststart the header comes last
        stream = container.add_stream("libx264", rate=30)
        stream.height, stream.width, stream.pix_fmt = 48, 64, "yuv420p"
        for image in moving(10):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        container.mux(stream.encode())
    path.write_bytes(path.read_bytes()[:400])
    assert "header is damaged" in refused(path)


def test_size_and_duration_are_refused_from_the_header(tmp_path):
    path = write_clip(tmp_path / "a.mp4", moving(12))
    assert "64×48 pixels" in refused(path, max_pixels=64 * 47)
    assert "longer than" in refused(path, max_seconds=0.2)
    assert len(read_video(path, max_pixels=64 * 48, max_seconds=0.5).images) == 12


def test_a_huge_picture_is_refused_before_it_is_decoded(tmp_path, monkeypatch):
    path = write_clip(tmp_path / "a.mp4", moving(3))
    data = bytearray(path.read_bytes())
    entry = data.index(b"avc1", data.index(b"stsd"))  # VisualSampleEntry: width, height at +28
    data[entry + 28 : entry + 32] = (10000).to_bytes(2, "big") * 2
    path.write_bytes(bytes(data))
    monkeypatch.setattr("model.video._decoded", lambda *_: pytest.fail("decoded"))
    refused(path, max_pixels=1000)


def test_a_folder_is_read_in_numeric_order(tmp_path):
    for number in (10, 2, 1):
        cv2.imwrite(str(tmp_path / f"frame_{number}.png"), np.full((6, 8, 3), number * 20, np.uint8))
    frames = read_video(tmp_path, fps=10.0)
    assert frames.images[:, 0, 0, 0].tolist() == [20, 40, 200]
    np.testing.assert_allclose(frames.times, [0, 0.1, 0.2])
    np.testing.assert_allclose(read_video(tmp_path).times, [0, 1 / 30, 2 / 30])
    assert "--fps nan" in refused(tmp_path, fps=float("nan"))


def test_a_video_file_carries_its_own_times(tmp_path):
    assert "--fps is for a folder of images" in refused(write_clip(tmp_path / "a.mp4", moving(3)), fps=10.0)


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_an_image_that_breaks_off_is_refused(tmp_path, suffix, capfd):
    noise = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
    for number in (1, 2):
        cv2.imwrite(str(tmp_path / f"{number}{suffix}"), noise)
    data = (tmp_path / f"2{suffix}").read_bytes()
    start_of_frame = data.find(b"\xff\xc0")
    for length in (len(data) // 2, len(data) - 3, start_of_frame + 6, 20):
        (tmp_path / f"2{suffix}").write_bytes(data[:length])
        with pytest.raises(InputError, match=f"2{suffix}: (the image breaks off|not a PNG or JPEG image)"):
            read_video(tmp_path)
    assert capfd.readouterr() == ("", "")


def test_what_is_no_image_in_a_folder_is_passed_over(tmp_path):
    for number in (1, 2):
        cv2.imwrite(str(tmp_path / f"{number}.png"), CORNERS)
    (tmp_path / "9.png").mkdir()
    (tmp_path / "._1.png").write_bytes(b"what a Mac leaves on a stick")
    assert len(read_video(tmp_path).images) == 2


def test_the_folder_one_is_in_is_named(tmp_path, monkeypatch):
    cv2.imwrite(str(tmp_path / "1.png"), CORNERS)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=f"{tmp_path.name}: 1 frame"):
        read_video(".")


def test_bad_folders_are_refused(tmp_path):
    assert "no numbered" in refused(tmp_path)
    cv2.imwrite(str(tmp_path / "1.jpg"), CORNERS)
    assert "at least 2" in refused(tmp_path)
    cv2.imwrite(str(tmp_path / "2.jpg"), CORNERS[:30])
    assert "frame size changes" in refused(tmp_path)
    cv2.imwrite(str(tmp_path / "2.jpg"), CORNERS)
    assert len(read_video(tmp_path).images) == 2
    with pytest.raises(InputError, match="64×48"):
        read_video(tmp_path, max_pixels=100)
    (tmp_path / "01.png").write_bytes(b"no picture")
    assert "same number" in refused(tmp_path)
    (tmp_path / "01.png").rename(tmp_path / "3.png")
    with pytest.raises(InputError, match="not a PNG or JPEG"):
        read_video(tmp_path)
