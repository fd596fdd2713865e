"""A twin written by the contract with nothing of the project's, and ways to break it."""

import json
import pickle
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest
import torch
from safetensors.numpy import save
from threadpoolctl import threadpool_info, threadpool_limits

from model import cli
from model.bundle import TwinBundle
from model.errors import InputError
from model.formats.movie import encode_mp4

if TYPE_CHECKING:
    from model.gap.report.findings import Findings
    from model.types import Observation

PROPERTIES = [
    *("x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"),
    *("opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"),
]


@pytest.fixture
def two_threads() -> Iterator[None]:
    """Torch and BLAS have two threads; what they had before comes back."""
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    with threadpool_limits(2, "blas"):
        yield
    torch.set_num_threads(before)


@pytest.fixture
def blas_threads() -> Callable[[], set[int]]:
    """How many threads each BLAS has that is loaded; there are numpy's and scipy's."""
    return lambda: {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def foreign_tensors(frames: int = 5) -> dict[str, np.ndarray]:
    """A cube of 3×3×3 points with its edges, held by two controllers above it."""
    rng = np.random.default_rng(7)
    grid = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3) * 0.03
    points = (grid + rng.uniform(-0.003, 0.003, grid.shape) + [0, 0, 0.25]).astype(np.float32)
    distance = np.linalg.norm(points[:, None] - points[None], axis=-1)
    springs = np.argwhere(np.triu((distance < 0.05) & (distance > 0))).astype(np.int32)
    top = np.argsort(-points[:, 2], kind="stable")[:2]
    controllers = points[top] + np.float32([0, 0, 0.02])
    controls = np.repeat(controllers[None], frames, axis=0)
    controls[:, :, 0] += 0.01 * np.arange(frames, dtype=np.float32)[:, None]
    return {
        "points": points,
        "mass": rng.uniform(0.002, 0.004, len(points)).astype(np.float32),
        "springs": springs,
        "rest_length": distance[springs[:, 0], springs[:, 1]].astype(np.float32),
        "stiffness": rng.uniform(30, 150, len(springs)).astype(np.float32),
        "part": (points[:, 0] > 0.03).astype(np.int32),
        "controller_points": controllers,
        "controller_springs": np.stack([np.arange(2), top], axis=1).astype(np.int32),
        "controller_rest_length": np.full(2, 0.02, np.float32),
        "controller_stiffness": np.full(2, 200, np.float32),
        "controls": controls,
        "binding_index": np.arange(len(points), dtype=np.int32)[:, None],
        "binding_weight": np.ones((len(points), 1), np.float32),
    }


def foreign_ply(points: np.ndarray, rest: int = 0) -> bytes:
    names = PROPERTIES[:9] + [f"f_rest_{i}" for i in range(rest)] + PROPERTIES[9:]
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property float {name}\n" for name in names) + "end_header\n"
    rows = np.zeros((len(points), len(names)), "<f4")
    rows[:, :3] = points
    rows[:, 9 + rest] = 3
    rows[:, 10 + rest : 13 + rest] = np.log(0.01)
    rows[:, 13 + rest] = 1
    return head.encode() + rows.tobytes()


def foreign_members(tensors: Mapping[str, np.ndarray]) -> dict[str, bytes]:
    """The files of a minimal bundle."""
    units = {"dashpot_damping": "N*s/m", "drag_rate": "1/s", "friction": "1", "restitution": "1"}
    values = {"dashpot_damping": 0.05, "drag_rate": 0.8, "friction": 0.4, "restitution": 0.1}
    parameters = {n: {"value": v, "unit": units[n], "source": "user"} for n, v in values.items()}
    parameters["collision_distance"] = {"value": 0.005, "unit": "m", "source": "user"}
    manifest = {
        "schema": "matphys.twin/1",
        "id": "check",
        "created": "2026-01-01T00:00:00Z",
        "version": "0",
        "units": "m kg s",
        "frame": "z-up",
        "source": {"fps": 30.0, "frames": 5},
        "stages": [],
        "warnings": [],
    }
    return {
        "twin.json": json.dumps(manifest).encode(),
        "gaussians.ply": foreign_ply(tensors["points"]),
        "system.safetensors": save({name: np.ascontiguousarray(value) for name, value in tensors.items()}),
        "parameters.json": json.dumps(parameters).encode(),
        "parts.json": b"[]",
    }


@dataclass(frozen=True)
class Outcome:
    """Of a command that was run."""

    code: int
    stdout: str
    stderr: str

    @property
    def line(self) -> str:
        """What a refusal says: one line, and nothing on stdout."""
        assert self.stdout == ""
        assert self.stderr.count("\n") == 1
        assert self.stderr.endswith("\n")
        return self.stderr.strip()


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Outcome]:
    """Runs `matphys` as a user would: `run("twin", …)`."""
    monkeypatch.delenv("MATPHYS_DEBUG", raising=False)

    def call(*arguments: object) -> Outcome:
        code = cli.main([str(argument) for argument in arguments])
        return Outcome(code, *capfd.readouterr())

    return call


@pytest.fixture
def tensors() -> dict[str, np.ndarray]:
    return foreign_tensors()


@pytest.fixture
def members(tensors: dict[str, np.ndarray]) -> dict[str, bytes]:
    return foreign_members(tensors)


@pytest.fixture
def write_twin(tmp_path: Path) -> Callable[..., Path]:
    """Write a foreign bundle, tensors (keywords) and members (`files`) replaced, or removed by None."""

    def write(
        name: str = "foreign.twin.zip", files: Mapping[str, bytes | None] | None = None, **changes
    ) -> Path:
        system = {**foreign_tensors(), **changes}
        intact = foreign_tensors()
        content = foreign_members(intact | {"points": intact["points"][: len(system["points"])]})
        content["system.safetensors"] = save(
            {key: np.ascontiguousarray(value) for key, value in system.items() if value is not None}
        )
        content |= files or {}
        with zipfile.ZipFile(tmp_path / name, "w", zipfile.ZIP_DEFLATED) as archive:
            for member, data in content.items():
                if data is not None:
                    archive.writestr(member, data)
        return tmp_path / name

    return write


@pytest.fixture
def twin_path(write_twin: Callable[..., Path]) -> Path:
    return write_twin()


@pytest.fixture
def refusal() -> Callable[[Path], str]:
    """Load a broken bundle and return the one line it is refused with."""

    def load(path: Path) -> str:
        with pytest.raises(InputError) as caught:
            TwinBundle.load(path)
        message = str(caught.value)
        assert "\n" not in message
        assert path.name in message
        assert len(message) < 300
        return message

    return load


@dataclass(frozen=True)
class Clip:
    """A video file and what is really in it."""

    path: Path
    images: np.ndarray
    """[T, H, W, 3]."""
    things: np.ndarray
    """Where the object is, [T, H, W] bool."""


@pytest.fixture(scope="session")
def plush_clip(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    """A hand lifts a blue plush from a plain table, 24 pixels high: 12 frames of 192×144."""
    rng, height, width, count = np.random.default_rng(0), 144, 192, 12

    def noise(amount: float, blur: float) -> np.ndarray:
        return cv2.GaussianBlur(rng.normal(0, amount, (height, width)).astype(np.float32), (0, 0), blur)

    table = np.float32([150, 158, 165]) + noise(6, 3)[..., None]
    light = np.interp(np.arange(height), [55, 118], [1.6, 0.5]).astype(np.float32)[:, None, None]
    fur = np.clip(np.float32([62, 88, 120]) * light + noise(60, 1.2)[..., None], 0, 255)
    thing, hand = np.zeros((height, width), np.uint8), np.zeros((height, width), np.uint8)
    cv2.ellipse(thing, (96, 96), (30, 22), 0, 0, 360, 255, -1)
    for center, radius in (((96, 70), 15), ((70, 108), 10), ((122, 108), 10)):
        cv2.circle(thing, center, radius, 255, -1)
    cv2.ellipse(hand, (96, 52), (11, 13), 0, 0, 360, 255, -1)
    cv2.line(hand, (96, 46), (120, -40), 255, 20)
    images, things = [], []
    for rise in 12 * (1 - np.cos(np.linspace(0, np.pi, count))):
        move = np.float32([[1, 0, 0], [0, 1, -rise]])
        moved = [cv2.warpAffine(each, move, (width, height)) for each in (thing, hand, fur)]
        image = table.copy()
        image[moved[0] > 127] = moved[2][moved[0] > 127]
        image[moved[1] > 127] = (214, 160, 130)
        image = cv2.GaussianBlur(image, (0, 0), 0.7) + rng.normal(0, 1.5, image.shape)
        images.append(np.clip(image, 0, 255).astype(np.uint8))
        things.append((moved[0] > 127) & (moved[1] <= 127))
    path = tmp_path_factory.mktemp("plush") / "plush.mp4"
    path.write_bytes(encode_mp4(images, np.arange(count) / 30))
    return Clip(path, np.stack(images), np.stack(things))


@pytest.fixture
def found() -> Callable[..., "Findings"]:
    """Findings about any observation, with numbers that belong together: `found(observation, effect)`."""
    return _found


def _found(observation: "Observation", effect: str = "wind") -> "Findings":
    from model.gap.report.findings import Findings
    from model.gap.schema import EFFECT_NAMES, SCHEMA, GapReport

    frames, points = observation.points.shape[:2]
    named = effect in EFFECT_NAMES
    first = sorted(EFFECT_NAMES, key=lambda name: name != effect)
    chances = [0.9 if named and i == 0 else 0.001 for i in range(len(first))]
    content = {
        "schema": SCHEMA,
        "verdict": {"effect": effect, "probability": 0.9},
        "gap": {
            "baseline": 0.02,
            "refit": 0.011,
            "noise_floor": 0.001,
            "heldout": [[0.0, float(observation.times[-1])]],
        }
        | ({"with_effect": 0.003, "closed_fraction": 0.8} if named else {}),
        "effects": [{"name": name, "probability": p} for name, p in zip(first, chances, strict=True)],
        "where": {
            "points": [1 / points] * points,
            "frames": [1 / frames] * frames,
            "acts_on": [float(named)] * points,
        },
        "sources": {
            "perception": 0.1,
            "actuation": 0.0,
            "parameters": 0.4,
            "physics": 0.5,
            "unexplained": 0.0,
        },
        "warnings": ["said by the diagnosis"],
    }
    rest = np.nan_to_num(observation.points[0])
    return Findings(
        report=GapReport.model_validate_json(json.dumps(content)),
        times=observation.times,
        observed=observation.points,
        before=np.repeat(rest[None], frames, 0),
        error_baseline=np.full(frames, 0.02),
        error_refit=np.full(frames, 0.011),
        rest=rest,
        controllers=observation.controllers,
        after=np.repeat(rest[None], frames, 0) if named else None,
        error_after=np.full(frames, 0.003) if named else None,
        ground_height=observation.ground_height,
    )


@pytest.fixture
def save_phystwin() -> Callable[..., Path]:
    """Writes a case in PhysTwin's format: a block of 12 x 5 x 4 cubes, lifted off a table, z down.

    `save_phystwin(folder, name, split, **changes)` returns the folder of the case; changes are of arrays.
    """
    frames, side = 10, 0.012
    grid = np.stack(np.meshgrid(np.arange(12), np.arange(5), np.arange(4), indexing="ij"), -1).reshape(-1, 3)
    jitter = np.random.default_rng(0).uniform(-0.2, 0.2, grid.shape)
    body = ((grid + 0.5 + jitter) * side) * [1.0, 1.0, -1.0]
    top = body[body[:, 2] < -2.9 * side]
    rise = 0.02 * np.arange(frames)[:, None, None] / frames * np.array([0.0, 0.0, -1.0])
    arrays = {
        "object_points": top + rise,
        "object_colors": np.tile(np.array([0.2, 0.4, 0.8]), (frames, len(top), 1)),
        "object_visibilities": np.ones((frames, len(top)), bool),
        "object_motions_valid": np.ones((frames, len(top)), bool),
        "controller_points": top[:4] - np.array([0.0, 0.0, 0.004]) + rise,
        "surface_points": body[body[:, 2] > -side],
        "interior_points": body[(body[:, 2] < -side) & (body[:, 2] > -2.9 * side)],
    }

    def write(folder: Path, name: str = "single_lift_sloth", split: object = None, **changes: object) -> Path:
        case = folder / name
        case.mkdir()
        kept = {key: value for key, value in (arrays | changes).items() if value is not None}
        (case / "final_data.pkl").write_bytes(pickle.dumps(kept))
        if split is not None:
            (case / "split.json").write_text(json.dumps(split))
        return case

    return write
