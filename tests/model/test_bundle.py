import base64
import json
import re
import stat
import subprocess
import sys
import zipfile
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load as load_tensors

from model import bundle as bundle_module
from model.bundle import TwinBundle
from model.errors import InputError
from model.schema import EffectRecord, PartRecord

PNG = base64.b64encode(b"\x89PNG\r\n\x1a\n" + b"0" * 8).decode()


def part(label: str) -> PartRecord:
    return PartRecord.model_validate(
        {
            "label": label,
            "materials": {"fabric": 0.75, "rubber": 0.25},
            "prior": {"stiffness": {"mean": 2e4, "spread": 0.5, "unit": "Pa"}},
            "stiffness": {"springs": 3, "mean": 80.0, "std": 4.0},
            "size": {"points": 13, "mass": 0.03, "extent": [0.03, 0.06, 0.06]},
            "overlay": PNG,
        }
    )


@pytest.fixture
def bundle(twin_path: Path) -> TwinBundle:
    """A bundle with something in every member."""
    wind = {"drag_per_mass": {"value": 0.5, "unit": "1/m"}, "x": 1.5, "y": 0}
    effect = EffectRecord(name="wind", parameters=wind)
    parts = (part("part 0"), part("part 1"))
    return replace(TwinBundle.load(twin_path), parts=parts, effects=(effect,), preview=b"not really an mp4")


class TestForeignBundle:
    def test_loads(self, twin_path: Path, tensors: dict[str, np.ndarray]):
        twin = TwinBundle.load(twin_path)
        np.testing.assert_array_equal(twin.topology.points, tensors["points"])
        np.testing.assert_array_equal(twin.parameters.stiffness, tensors["stiffness"])
        np.testing.assert_array_equal(twin.controls, tensors["controls"])
        np.testing.assert_allclose(twin.gaussians.scales, 0.01, rtol=1e-6)
        np.testing.assert_allclose(twin.gaussians.opacities, 1 / (1 + np.exp(-3)), rtol=1e-6)
        np.testing.assert_allclose(twin.gaussians.colors, 0.5)
        assert twin.parameters.globals["drag_rate"].value == 0.8
        assert twin.manifest.source.fps == 30
        assert twin.effects == ()
        assert twin.preview is None
        assert twin.camera is None

    def test_controllers_may_be_absent(self, write_twin: Callable[..., Path]):
        names = ["controls", "controller_points", "controller_springs"]
        names += ["controller_rest_length", "controller_stiffness"]
        twin = TwinBundle.load(write_twin(**dict.fromkeys(names)))
        assert twin.controls is None
        assert twin.topology.controller_points.shape == (0, 3)
        assert twin.topology.controller_springs.shape == (0, 2)
        assert twin.parameters.controller_stiffness.shape == (0,)

    def test_controllers_may_be_empty(self, write_twin: Callable[..., Path]):
        empty = np.zeros(0, np.float32)
        twin = TwinBundle.load(
            write_twin(
                controls=np.zeros((0, 0, 3), np.float32),
                controller_points=np.zeros((0, 3), np.float32),
                controller_springs=np.zeros((0, 2), np.int32),
                controller_rest_length=empty,
                controller_stiffness=empty,
            )
        )
        assert twin.controls is None
        assert twin.topology.controller_springs.shape == (0, 2)

    def test_controllers_are_where_the_controls_start(self, write_twin, tensors):
        twin = TwinBundle.load(write_twin(controller_points=None))
        np.testing.assert_array_equal(twin.topology.controller_points, tensors["controls"][0])

    def test_wide_numbers_become_narrow(self, write_twin, tensors):
        wide = {
            name: value.astype(np.float64 if value.dtype.kind == "f" else np.int64)
            for name, value in tensors.items()
        }
        twin = TwinBundle.load(write_twin(**wide))
        assert twin.topology.points.dtype == np.float32
        assert twin.topology.springs.dtype == np.int32
        np.testing.assert_array_equal(twin.topology.springs, tensors["springs"])

    def test_a_bare_manifest_is_enough(self, write_twin):
        twin = TwinBundle.load(write_twin(files={"twin.json": b'{"schema": "matphys.twin/1"}'}))
        assert twin.manifest.source.fps is None

    def test_unknown_tensors_and_members_are_left_alone(self, write_twin):
        TwinBundle.load(write_twin(files={"README.txt": b"hello"}, velocity=np.zeros(3, np.float16)))

    def test_unknown_keys_survive(self, write_twin, tmp_path: Path):
        manifest = {"schema": "matphys.twin/1", "laboratory": {"name": "elsewhere"}}
        twin = TwinBundle.load(write_twin(files={"twin.json": json.dumps(manifest).encode()}))
        twin.save(tmp_path / "again.twin.zip")
        saved = json.loads(zipfile.ZipFile(tmp_path / "again.twin.zip").read("twin.json"))
        assert saved["laboratory"] == {"name": "elsewhere"}


class TestSaving:
    def test_round_trip(self, bundle: TwinBundle, tmp_path: Path):
        path = tmp_path / "twin.twin.zip"
        bundle.save(path)
        again = TwinBundle.load(path)
        assert again.manifest == bundle.manifest
        assert again.parts == bundle.parts
        assert again.effects == bundle.effects
        assert again.preview == bundle.preview
        assert again.parameters.globals == bundle.parameters.globals
        for name, value in vars(bundle.topology).items():
            np.testing.assert_array_equal(getattr(again.topology, name), value)
        for name in ("means", "scales", "quaternions", "opacities", "colors"):
            np.testing.assert_allclose(
                getattr(again.gaussians, name), getattr(bundle.gaussians, name), rtol=1e-5
            )

    def test_same_content_same_bytes(self, bundle: TwinBundle, tmp_path: Path):
        bundle.save(tmp_path / "a.twin.zip")
        bundle.save(tmp_path / "b.twin.zip")
        assert (tmp_path / "a.twin.zip").read_bytes() == (tmp_path / "b.twin.zip").read_bytes()
        entries = zipfile.ZipFile(tmp_path / "a.twin.zip").infolist()
        assert {entry.date_time for entry in entries} == {(1980, 1, 1, 0, 0, 0)}

    def test_same_bytes_in_another_process(self, twin_path: Path, tmp_path: Path):
        code = "import sys; from pathlib import Path; from model.bundle import TwinBundle as T\n"
        code += "T.load(Path(sys.argv[1])).save(Path(sys.argv[2]))"
        for seed in ("1", "2"):
            out = str(tmp_path / f"{seed}.twin.zip")
            subprocess.run(
                [sys.executable, "-c", code, twin_path, out], check=True, env={"PYTHONHASHSEED": seed}
            )
        assert (tmp_path / "1.twin.zip").read_bytes() == (tmp_path / "2.twin.zip").read_bytes()

    def test_members_are_those_of_the_contract(self, bundle: TwinBundle, tmp_path: Path):
        bundle.save(tmp_path / "twin.twin.zip")
        names = zipfile.ZipFile(tmp_path / "twin.twin.zip").namelist()
        expected = ["twin.json", "gaussians.ply", "system.safetensors", "parameters.json", "parts.json"]
        assert names == [*expected, "effects.json", "preview.mp4"]
        replace(bundle, effects=(), preview=None).save(tmp_path / "twin.twin.zip")
        assert zipfile.ZipFile(tmp_path / "twin.twin.zip").namelist() == expected

    def test_an_independent_reader_agrees(self, bundle: TwinBundle, tmp_path: Path):
        """What `twin_check.py` asks for, read without the project."""
        bundle.save(tmp_path / "twin.twin.zip")
        archive = zipfile.ZipFile(tmp_path / "twin.twin.zip")
        assert archive.testzip() is None
        assert json.loads(archive.read("twin.json"))["schema"] == "matphys.twin/1"
        system = load_tensors(archive.read("system.safetensors"))
        assert {
            name: str(value.dtype) for name, value in system.items() if value.dtype.kind == "i"
        } == dict.fromkeys(("springs", "part", "controller_springs", "binding_index"), "int32")
        assert system["springs"].max() < len(system["points"])
        assert len(np.unique(np.sort(system["springs"], axis=1), axis=0)) == len(system["springs"])
        head = archive.read("gaussians.ply")[:6000].decode("latin-1")
        properties = re.findall(r"property float (\S+)", head)
        assert properties[:3] == ["x", "y", "z"]
        assert properties[-4:] == ["rot_0", "rot_1", "rot_2", "rot_3"]
        assert int(re.search(r"element vertex (\d+)", head).group(1)) == len(system["binding_index"])
        parameters = json.loads(archive.read("parameters.json"))
        assert parameters["friction"] == {"value": 0.4, "unit": "1", "source": "user", "std": None}

    def test_a_failure_leaves_the_old_file(
        self, bundle: TwinBundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ):
        path = tmp_path / "folder" / "twin.twin.zip"
        bundle.save(path)
        old = path.read_bytes()

        def fail_half_way(target: Path, members: dict[str, bytes]) -> None:
            target.write_bytes(b"half")
            raise OSError("No space left on device")

        monkeypatch.setattr(bundle_module, "write_archive", fail_half_way)
        with pytest.raises(OSError, match="No space left"):
            bundle.save(path)
        assert path.read_bytes() == old
        assert list(path.parent.iterdir()) == [path]

    def test_a_bundle_that_breaks_the_contract_is_not_written(self, bundle: TwinBundle, tmp_path: Path):
        springs = bundle.topology.springs.copy()
        springs[0, 1] = 999
        broken = replace(bundle, topology=replace(bundle.topology, springs=springs))
        with pytest.raises(RuntimeError, match="springs"):
            broken.save(tmp_path / "out" / "twin.twin.zip")
        assert list((tmp_path / "out").iterdir()) == []

    def test_the_mode_is_that_of_an_ordinary_file(self, bundle: TwinBundle, tmp_path: Path):
        bundle.save(tmp_path / "twin.twin.zip")
        (tmp_path / "ordinary").touch()
        modes = [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("twin.twin.zip", "ordinary")]
        assert modes[0] == modes[1]

    @pytest.mark.parametrize("place", ["folder", "file/twin.twin.zip"])
    def test_impossible_places_are_refused(self, bundle: TwinBundle, tmp_path: Path, place: str):
        (tmp_path / "folder").mkdir()
        (tmp_path / "file").touch()
        with pytest.raises(InputError, match="cannot write"):
            bundle.save(tmp_path / place)


@pytest.mark.parametrize(
    "member", ["twin.json", "gaussians.ply", "system.safetensors", "parameters.json", "parts.json"]
)
def test_missing_members_are_refused(member: str, write_twin, refusal):
    assert f"{member} is missing" in refusal(write_twin(files={member: None}))


@pytest.mark.parametrize(
    ("belief", "line"),
    [
        (
            {"mean": 1.1, "unit": "g/cm^3"},
            "parts.json: 1.prior.density.unit: expected kg/m^3, found 'g/cm^3'",
        ),
        ({"mean": 0.0, "unit": "kg/m^3"}, "parts.json: 1.prior.density.mean: input should be greater than 0"),
        (
            {"mean": -5.0, "unit": "kg/m^3"},
            "parts.json: 1.prior.density.mean: input should be greater than 0",
        ),
    ],
)
def test_beliefs_that_cannot_be_are_refused(write_twin, refusal, belief: dict[str, object], line: str):
    records = [{"label": 0}, {"label": 1, "prior": {"density": {"spread": 0.3, **belief}}}]
    assert line in refusal(write_twin(files={"parts.json": json.dumps(records).encode()}))


def reference_rollout(tensors: dict[str, np.ndarray], gravity: list[float], substeps: int) -> np.ndarray:
    """Semi-implicit Euler of the design's equations, in float64 and by itself."""
    system = {
        name: value.astype(float) if value.dtype.kind == "f" else value for name, value in tensors.items()
    }
    points, motion = system["points"].copy(), system["controls"]
    i, j = system["springs"].T
    c, p = system["controller_springs"].T
    dt, speed, frames = 1 / 30 / substeps, np.zeros_like(points), [points.copy()]

    def pull(way, rate, stiffness, rest):
        length = np.linalg.norm(way, axis=1, keepdims=True)
        axis = way / length
        return (
            stiffness[:, None] * (length - rest[:, None]) + 0.05 * (rate * axis).sum(1, keepdims=True)
        ) * axis

    for before, after in pairwise(motion):
        for step in range(1, substeps + 1):
            hand = before + (after - before) * step / substeps
            force = np.zeros_like(points)
            inner = pull(
                points[j] - points[i], speed[j] - speed[i], system["stiffness"], system["rest_length"]
            )
            np.add.at(force, i, inner)
            np.add.at(force, j, -inner)
            rate = (after - before)[c] * 30 - speed[p]
            springs = system["controller_stiffness"], system["controller_rest_length"]
            np.add.at(force, p, pull(hand[c] - points[p], rate, *springs))
            speed = (speed + dt * (force / system["mass"][:, None] + gravity)) * np.exp(-0.8 * dt)
            points = points + dt * speed
        frames.append(points.copy())
    return np.stack(frames)


class TestRollout:
    @pytest.mark.parametrize("gravity", [[0.0, 0.0, -9.81], [2.0, 0.0, -3.0]])
    def test_an_independent_reference_agrees(self, write_twin, members, tensors, gravity: list[float]):
        parameters = json.loads(members["parameters.json"])
        parameters["gravity"] = {"value": gravity, "unit": "m/s^2", "source": "user"}
        twin = TwinBundle.load(write_twin(files={"parameters.json": json.dumps(parameters).encode()}))
        rollout = twin.rollout()
        expected = reference_rollout(tensors, gravity, 400)
        np.testing.assert_allclose(rollout.times, np.arange(5) / 30)
        moved = np.abs(expected - expected[0]).max()
        assert moved > 0.02
        assert np.abs(rollout.points - expected).max() < 0.02 * moved

    def test_progress_reaches_the_end(self, twin_path: Path):
        shares: list[float] = []
        TwinBundle.load(twin_path).rollout(progress=shares.append, substeps=20)
        assert shares == [0.25, 0.5, 0.75, 1.0]

    @pytest.mark.parametrize(
        ("source", "frames"),
        [({"fps": 50, "frames": 3}, 3), ({"fps": 50, "frames": 3, "keyframe": 1}, 2), ({"fps": 3}, 4)],
    )
    def test_without_controls_the_clip_says_how_long(
        self, write_twin, tensors, source: dict[str, float], frames: int
    ):
        manifest = json.dumps({"schema": "matphys.twin/1", "source": source}).encode()
        twin = TwinBundle.load(
            write_twin(files={"twin.json": manifest}, controls=None, stiffness=tensors["stiffness"] / 100)
        )
        np.testing.assert_allclose(twin.rollout(substeps=120).times, np.arange(frames) / source["fps"])


def test_a_clip_without_end_is_refused(write_twin):
    manifest = json.dumps({"schema": "matphys.twin/1", "source": {"fps": 30, "frames": 10**30}}).encode()
    with pytest.raises(InputError, match=r"twin\.json: source\.frames: .*100000"):
        TwinBundle.load(write_twin(files={"twin.json": manifest}, controls=None))


def test_the_camera_of_the_manifest(write_twin):
    pose = np.eye(4)
    pose[:3, 3] = [0.1, 0.2, 0.3]
    record = {"intrinsics": [[500, 0, 320], [0, 500, 240], [0, 0, 1]], "world_from_camera": pose.tolist()}
    source = {"width": 640, "height": 480, "camera": record}
    manifest = json.dumps({"schema": "matphys.twin/1", "source": source}).encode()
    camera = TwinBundle.load(write_twin(files={"twin.json": manifest})).camera
    assert camera is not None
    assert (camera.width, camera.height) == (640, 480)
    np.testing.assert_array_equal(camera.position, [0.1, 0.2, 0.3])
    assert camera.intrinsics[0, 2] == 320
