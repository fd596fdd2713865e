import io
import stat
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from model.bundle import TwinBundle
from model.errors import InputError


class TestBrokenArchive:
    def test_absent(self, tmp_path: Path, refusal):
        assert "no such file" in refusal(tmp_path / "absent.twin.zip")

    def test_folder(self, tmp_path: Path, refusal):
        assert "no such file" in refusal(tmp_path)

    @pytest.mark.parametrize(
        ("content", "found"),
        [
            (b"", "an empty file"),
            (b"hello", "something else"),
            (b"PK\x03\x04" + b"0" * 99, "a truncated one"),
        ],
    )
    def test_no_archive(self, tmp_path: Path, content: bytes, found: str, refusal):
        path = tmp_path / "bad.twin.zip"
        path.write_bytes(content)
        assert f"expected a zip archive, found {found}" in refusal(path)

    @pytest.mark.parametrize("cut", [3, 30, 400, 2000])
    def test_truncated(self, twin_path: Path, cut: int, refusal):
        twin_path.write_bytes(twin_path.read_bytes()[:-cut])
        refusal(twin_path)

    def test_every_damaged_byte_is_survived(self, twin_path: Path, refusal):
        """Whatever a byte is turned into, the bundle loads or is refused with one line."""
        whole = twin_path.read_bytes()
        rng = np.random.default_rng(3)
        lines = []
        for place in [*range(len(whole) - 420, len(whole)), *rng.integers(0, len(whole), 200)]:
            broken = bytearray(whole)
            broken[place] ^= int(rng.integers(1, 256))
            twin_path.write_bytes(broken)
            try:
                TwinBundle.load(twin_path)
            except InputError as error:
                lines.append(str(error))
        assert len(lines) > 100
        assert not any("\n" in line for line in lines)

    @pytest.mark.parametrize("member", ["../evil", "a/../../evil", "/etc/passwd", "..\\evil", "C:\\evil"])
    def test_path_outside(self, write_twin, member: str, refusal):
        assert "points outside of the archive" in refusal(write_twin(files={member: b"x"}))

    @pytest.mark.parametrize("member", ["weights.pkl", "model.PT", "a/b.pickle", "x.ckpt"])
    def test_pickle(self, write_twin, member: str, refusal):
        assert "could be a pickle" in refusal(write_twin(files={member: b"x"}))

    def test_member_twice(self, twin_path: Path, refusal):
        with zipfile.ZipFile(twin_path, "a") as archive, pytest.warns(UserWarning, match="Duplicate"):
            archive.writestr("twin.json", b"{}")
        assert "'twin.json' is there twice" in refusal(twin_path)

    def test_link(self, twin_path: Path, refusal):
        entry = zipfile.ZipInfo("preview.mp4")
        entry.external_attr = (stat.S_IFLNK | 0o777) << 16
        with zipfile.ZipFile(twin_path, "a") as archive:
            archive.writestr(entry, "/etc/passwd")
        assert "symbolic link" in refusal(twin_path)

    def test_bomb(self, write_twin, refusal):
        path = write_twin(files={"parameters.json": b" " * (8 << 20)})
        assert path.stat().st_size < 100_000
        assert "parameters.json: expected at most 1 MiB, found 8 MiB" in refusal(path)

    def test_bomb_that_lies_about_its_size(self, write_twin, refusal):
        path = write_twin(files={"parameters.json": b" " * (8 << 20)})
        data = path.read_bytes()
        assert data.count(struct.pack("<I", 8 << 20)) == 2
        path.write_bytes(data.replace(struct.pack("<I", 8 << 20), struct.pack("<I", 100)))
        refusal(path)

    def test_too_many_members(self, write_twin, refusal):
        path = write_twin(files={f"{i}.txt": b"" for i in range(300)})
        assert "expected at most 256 members" in refusal(path)

    def test_table_of_contents_hidden_in_zip64(self, twin_path: Path, refusal):
        data = twin_path.read_bytes()
        end = data.rindex(b"PK\x05\x06")
        twin_path.write_bytes(data[:end] + b"PK\x06\x07" + bytes(16) + data[end:])
        assert "expected at most 256 members" in refusal(twin_path)

    def test_dear_compression(self, members: dict[str, bytes], tmp_path: Path, refusal):
        path = tmp_path / "dear.twin.zip"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_LZMA) as archive:
            for name, data in members.items():
                archive.writestr(name, data)
        assert "expected it stored or deflated" in refusal(path)

    def test_encrypted(self, twin_path: Path, refusal):
        data = bytearray(twin_path.read_bytes())
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            place = data.index(b"PK\x01\x02")
            assert archive.infolist()[0].filename == "twin.json"
        data[place + 8] |= 1
        twin_path.write_bytes(data)
        assert "twin.json is encrypted" in refusal(twin_path)
