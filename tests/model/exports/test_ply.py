from pathlib import Path

import numpy as np
import pytest
import trimesh

from model.bundle import TwinBundle
from model.errors import InputError
from model.exports import ALL_EXPORTERS, exporter_of
from model.exports.mechanics import roll
from model.exports.ply import PlyExporter
from model.formats.ply import decode_ply, encode_ply
from model.types import Gaussians


@pytest.fixture
def gaussians() -> Gaussians:
    rng = np.random.default_rng(4)
    turns = rng.normal(size=(50, 4)).astype(np.float32)
    return Gaussians(
        means=rng.normal(size=(50, 3)).astype(np.float32),
        scales=rng.uniform(0.001, 0.1, (50, 3)).astype(np.float32),
        quaternions=turns / np.linalg.norm(turns, axis=1, keepdims=True),
        opacities=rng.uniform(0.01, 0.99, 50).astype(np.float32),
        colors=rng.uniform(size=(50, 3)).astype(np.float32),
        volumes=rng.uniform(1e-6, 1e-5, 50).astype(np.float32),
    )


def test_exporters_have_names_of_the_contract():
    names = [exporter.name for exporter in ALL_EXPORTERS]
    assert len(set(names)) == len(names)
    assert set(names) == {"mujoco", "newton", "usd", "ply", "glb", "phystwin"}


def test_says_what_it_wrote(twin_path: Path, tmp_path: Path):
    out = tmp_path / "new" / "twin.ply"
    assert PlyExporter()(TwinBundle.load(twin_path), out) == [out]
    assert [path.name for path in out.parent.iterdir()] == ["twin.ply"]


def test_another_reader_finds_the_vertices(gaussians: Gaussians, tmp_path: Path):
    (tmp_path / "twin.ply").write_bytes(encode_ply(gaussians))
    np.testing.assert_array_equal(trimesh.load(tmp_path / "twin.ply").vertices, gaussians.means)


def test_every_property_means_what_viewers_expect(gaussians: Gaussians):
    """Decoded with the formulas of the 3DGS code rather than with ours."""
    data = encode_ply(gaussians)
    head, body = data.split(b"end_header\n", 1)
    names = [line.split()[2] for line in head.decode().splitlines() if line.startswith("property")]
    columns = dict(zip(names, np.frombuffer(body, "<f4").reshape(50, -1).T, strict=True))
    np.testing.assert_allclose(1 / (1 + np.exp(-columns["opacity"])), gaussians.opacities, rtol=1e-5)
    np.testing.assert_allclose(np.exp(columns["scale_1"]), gaussians.scales[:, 1], rtol=1e-5)
    np.testing.assert_allclose(
        0.5 + 0.28209479177387814 * columns["f_dc_2"], gaussians.colors[:, 2], atol=1e-6
    )
    np.testing.assert_array_equal(columns["rot_0"], gaussians.quaternions[:, 0])
    assert not columns["nx"].any()


@pytest.mark.parametrize("rest", [0, 9, 45])
def test_round_trip(gaussians: Gaussians, rest: int):
    harmonics = np.random.default_rng(1).normal(size=(50, rest)).astype(np.float32) if rest else None
    full = Gaussians(**{**vars(gaussians), "harmonics": harmonics})
    again = decode_ply(encode_ply(full), "x")
    for name in ("means", "scales", "quaternions", "opacities", "colors"):
        np.testing.assert_allclose(getattr(again, name), getattr(full, name), rtol=2e-5, atol=1e-6)
    if rest:
        np.testing.assert_array_equal(again.harmonics, harmonics)
    else:
        assert again.harmonics is None
    ellipsoids = 4 / 3 * np.pi * gaussians.scales.prod(axis=1)
    np.testing.assert_allclose(again.volumes, ellipsoids, rtol=1e-4)


def test_certain_opacities_stay_finite(gaussians: Gaussians):
    sure = Gaussians(**{**vars(gaussians), "opacities": np.ones(50, np.float32)})
    assert np.isfinite(decode_ply(encode_ply(sure), "x").opacities).all()


def test_a_folder_is_refused(twin_path: Path, tmp_path: Path):
    with pytest.raises(InputError, match="it is a folder"):
        PlyExporter()(TwinBundle.load(twin_path), tmp_path)


def test_a_file_per_frame_moves_as_the_twin_does(rope: TwinBundle, tmp_path: Path):
    written = PlyExporter(every_frame=True)(rope, tmp_path / "frames")
    files = sorted(path for path in written if path.suffix == ".ply")
    moved = roll(rope).points
    assert len(files) == len(moved)
    for frame in (0, 12, len(moved) - 1):
        np.testing.assert_allclose(trimesh.load(files[frame]).vertices, moved[frame], atol=1e-5)
    assert "30 per second" in (tmp_path / "frames" / "README.md").read_text()


def test_the_readme_is_in_the_header(rope: TwinBundle, tmp_path: Path):
    PlyExporter()(rope, tmp_path / "twin.ply")
    data = (tmp_path / "twin.ply").read_bytes()
    head = data[: data.index(b"end_header")].decode("ascii")
    assert "comment World frame: right-handed, z up" in head
    assert "cannot express" in head
    assert trimesh.load(tmp_path / "twin.ply").vertices.shape == (len(rope.gaussians), 3)
    assert len(decode_ply(data, "x")) == len(rope.gaussians)


def test_frames_of_another_format_are_refused():
    with pytest.raises(InputError, match="--frames: glb"):
        exporter_of("glb", every_frame=True)
