"""What cannot be used gets one line and exit code 2, and leaves nothing behind: the real command line."""

import json
import zipfile
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest

from model import cli
from model.formats.movie import encode_mp4


@pytest.fixture
def refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[..., str]:
    """Run a command that has to refuse what it is given; return the one line it says."""
    monkeypatch.delenv("MATPHYS_DEBUG", raising=False)

    def run(*arguments: object) -> str:
        before = set(tmp_path.rglob("*"))
        capfd.readouterr()
        code = cli.main([str(argument) for argument in (*arguments, "--quiet")])
        out, err = capfd.readouterr()
        assert code == 2, err
        assert out == ""
        assert err.count("\n") == 1
        assert err.endswith("\n")
        assert "Traceback" not in err
        assert set(tmp_path.rglob("*")) == before
        return err.strip()

    return run


@pytest.fixture
def twin(refused, tmp_path: Path) -> Callable[..., str]:
    """Refuse to make a twin of a clip."""
    new = tmp_path / "new"
    return lambda clip, *options: refused(
        "twin", clip, "--out", new / "a.twin.zip", "--preview", new / "a.mp4", *options
    )


def movie(path: Path, images: np.ndarray) -> Path:
    path.write_bytes(encode_mp4(images, np.arange(len(images)) / 30))
    return path


class TestClips:
    def test_an_empty_file(self, twin, tmp_path: Path):
        (tmp_path / "a.mp4").touch()
        assert "a.mp4" in twin(tmp_path / "a.mp4")

    def test_a_text_file_named_mp4(self, twin, tmp_path: Path):
        (tmp_path / "a.mp4").write_text("Dear diary,\nno video today.\n")
        assert "not a readable video" in twin(tmp_path / "a.mp4")

    def test_a_truncated_clip(self, twin, plush_clip, tmp_path: Path):
        data = plush_clip.path.read_bytes()
        (tmp_path / "a.mp4").write_bytes(data[: len(data) * 6 // 10])
        assert "breaks off after frame" in twin(tmp_path / "a.mp4")

    def test_one_frame(self, twin, plush_clip, tmp_path: Path):
        assert "at least 2" in twin(movie(tmp_path / "a.mp4", plush_clip.images[:1]))

    def test_ten_thousand_pixels_wide_and_high(self, twin, tmp_path: Path):
        """The header alone says so: nothing of that size is ever held."""
        path = tmp_path / "a.mkv"
        with av.open(str(path), "w") as container:
            stream = container.add_stream("mjpeg", rate=30)
            stream.width = stream.height = 10_000
            stream.pix_fmt = "yuvj420p"
            for frame in range(3):
                packet = av.Packet(bytes(64))
                packet.stream, packet.pts, packet.dts = stream, frame, frame
                packet.time_base = Fraction(1, 30)
                container.mux(packet)
        line = twin(path)
        assert "10000×10000 pixels" in line

    @pytest.mark.parametrize("level", [0, 128])
    def test_a_blank_clip_holds_no_object(self, twin, tmp_path: Path, level: int):
        line = twin(movie(tmp_path / "a.mp4", np.full((8, 96, 128, 3), level, np.uint8)))
        assert "object" in line
        assert "--mask" in line or "--box" in line

    def test_no_such_file(self, twin, tmp_path: Path):
        assert "none.mp4" in twin(tmp_path / "none.mp4")


class TestOptions:
    def test_a_mask_of_the_wrong_size(self, twin, plush_clip, tmp_path: Path):
        cv2.imwrite(str(tmp_path / "m.png"), np.full((100, 100), 255, np.uint8))
        line = twin(plush_clip.path, "--mask", tmp_path / "m.png")
        assert "m.png" in line
        assert "192" in line

    def test_an_empty_mask(self, twin, plush_clip, tmp_path: Path):
        cv2.imwrite(str(tmp_path / "m.png"), np.zeros((144, 192), np.uint8))
        assert "m.png" in twin(plush_clip.path, "--mask", tmp_path / "m.png")

    def test_a_box_outside_of_the_picture(self, twin, plush_clip):
        assert "box" in twin(plush_clip.path, "--box", "500,500,20,20")

    def test_a_keyframe_after_the_end(self, twin, plush_clip):
        assert "keyframe" in twin(plush_clip.path, "--keyframe", "12")

    def test_a_nan_camera(self, twin, plush_clip, tmp_path: Path):
        camera = {"intrinsics": [[float("nan"), 0, 96], [0, 200, 72], [0, 0, 1]]}
        (tmp_path / "c.json").write_text(json.dumps(camera))
        line = twin(plush_clip.path, "--camera", tmp_path / "c.json")
        assert "c.json" in line
        assert "finite" in line

    @pytest.mark.parametrize("size", ["nan", "-1", "0", "inf"])
    def test_an_impossible_size(self, twin, plush_clip, size: str):
        assert "size" in twin(plush_clip.path, f"--size-m={size}")

    @pytest.mark.parametrize(
        ("content", "expected"),
        [
            ({"positions": np.zeros((12, 1, 3))}, "controllers is missing"),
            ({"controllers": np.zeros((12, 3))}, "expected shape"),
            ({"controllers": np.full((12, 1, 3), np.nan)}, "finite"),
            ({"controllers": np.zeros((5, 1, 3))}, "expected 12 rows"),
        ],
    )
    def test_wrong_controllers(self, twin, plush_clip, tmp_path: Path, content, expected: str):
        np.savez(tmp_path / "c.npz", **content)
        line = twin(plush_clip.path, "--controllers", tmp_path / "c.npz", "--keyframe", "0")
        assert "c.npz" in line
        assert expected in line

    def test_an_unreadable_mesh(self, twin, plush_clip, tmp_path: Path):
        (tmp_path / "m.glb").write_bytes(b"glTF, or so it says")
        assert "m.glb" in twin(plush_clip.path, "--mesh", tmp_path / "m.glb")

    @pytest.mark.parametrize(
        "option", ["--segmentation", "--tracking", "--reconstruction", "--encoder", "--prior", "--renderer"]
    )
    def test_an_unknown_method(self, twin, plush_clip, option: str):
        assert "'magic': choose one of" in twin(plush_clip.path, option, "magic")


class TestBundles:
    def broken(self, refused, path: Path) -> str:
        out = path.parent / "new" / "out.npz"
        line = refused("simulate", path, "--out", out, "--video", out.with_suffix(".mp4"))
        assert path.name in line
        return line

    def test_a_wrong_index(self, refused, write_twin, tensors):
        springs = tensors["springs"].copy()
        springs[3, 1] = len(tensors["points"])
        assert "springs" in self.broken(refused, write_twin(springs=springs))

    @pytest.mark.parametrize("name", ["../evil.txt", "/etc/evil", "a/../../evil"])
    def test_a_path_that_leads_outside(self, refused, twin_path: Path, name: str):
        with zipfile.ZipFile(twin_path, "a") as archive:
            archive.writestr(name, b"evil")
        self.broken(refused, twin_path)

    def test_no_zip_at_all(self, refused, tmp_path: Path):
        (tmp_path / "a.twin.zip").write_bytes(b"")
        assert "zip" in self.broken(refused, tmp_path / "a.twin.zip")
