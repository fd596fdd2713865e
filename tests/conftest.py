"""Shared fixtures. Array shapes in annotations are checked by beartype while tests run, in first calls."""

import contextlib
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings
from jaxtyping import install_import_hook

from tests.typechecked import begin_test

if TYPE_CHECKING:
    from model.scenes.case import Case

install_import_hook(("model",), "tests.typechecked.first_calls")
# how long an example takes says something of the machine alone
settings.register_profile("untimed", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("untimed")


def pytest_runtest_setup() -> None:
    """Each test has its first calls."""
    begin_test()


def _film(
    frames: int = 6,
    size: tuple[int, int] = (64, 48),
    container: str = "mp4",
    rate: int = 30,
    codec: str = "mpeg4",
) -> bytes:
    import av
    import numpy as np

    options = {"movflags": "faststart"} if container == "mp4" else {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "clip"
        with av.open(str(path), "w", format=container, options=options) as out:
            stream = out.add_stream(codec, rate=rate)
            stream.width, stream.height = size
            stream.pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
            for index in range(frames):
                image = np.zeros((size[1], size[0], 3), np.uint8)
                image[:, index % size[0] :][:, :8] = 255
                out.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
            out.mux(stream.encode())
        return path.read_bytes()


@pytest.fixture(scope="session")
def film() -> Callable[..., bytes]:
    """Makes tiny clips of something that moves: `film(frames=…, size=…, container=…, rate=…, codec=…)`."""
    return _film


@pytest.fixture(scope="session")
def living() -> Callable[..., list[int]]:
    """Ids of the processes that live, `living(pid=…)` or `living(group=…)`: at most this one, or its group.

    What has ended and only waits to be collected does not live. Skips where there is no /proc.
    """
    if not Path("/proc/self").is_dir():
        pytest.skip("looks at processes through /proc")
    return _living


def _living(pid: int | None = None, group: int | None = None) -> list[int]:
    found = []
    for entry in Path("/proc").glob("[0-9]*" if pid is None else str(pid)):
        with contextlib.suppress(OSError):
            state, _, its_group = (entry / "stat").read_text().rpartition(")")[2].split()[:3]
            if state not in "ZX" and group in (None, int(its_group)):
                found.append(int(entry.name))
    return found


@pytest.fixture(scope="session")
def make_case() -> "Callable[..., Case]":
    """Makes small cases: a two-part foam bar that lies on the ground and is lifted at one end, and its truth.

    `make_case(seed=…, modulus=(…, …), frames=…, noise=…, interaction=…)`.
    """
    return _make_case


def _make_case(
    seed: int = 0,
    modulus: tuple[float, float] = (4e3, 4e4),
    frames: int = 16,
    noise: float = 0.0,
    lift: float = 0.25,
    name: str | None = None,
) -> "Case":
    import numpy as np
    from scipy.spatial import cKDTree

    from model.predictor.prior_mean import PriorMeanPredictor
    from model.priors.materials import MATERIALS, combine
    from model.scenes.anchors import anchor
    from model.scenes.case import Case, Truth
    from model.scenes.replay import replay
    from model.types import Estimate, MaterialPrior, Observation, Topology

    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(np.arange(8), np.arange(3), np.arange(3), indexing="ij"), -1).reshape(-1, 3)
    points = (0.02 * grid + rng.uniform(-0.001, 0.001, grid.shape) + (0.0, 0.0, 0.003)).astype(np.float32)
    springs = cKDTree(points).query_pairs(0.037, output_type="ndarray").astype(np.int32)
    part = (grid[:, 0] >= 4).astype(np.int32)
    controller = points[(grid[:, 0] == 0) & (grid[:, 2] == 2)] + np.float32(0.008)
    near = cKDTree(points).query(controller, 4)[1]
    pairs = np.stack([np.repeat(np.arange(len(controller)), 4), near.ravel()], axis=1).astype(np.int32)
    lengths = np.linalg.norm(controller[pairs[:, 0]] - points[pairs[:, 1]], axis=1).astype(np.float32)
    topology = Topology(
        points=points,
        mass=np.full(len(points), 150.0 * 0.02**3, np.float32),
        springs=springs,
        rest_length=np.linalg.norm(points[springs[:, 0]] - points[springs[:, 1]], axis=1).astype(np.float32),
        part=part,
        binding_index=np.zeros((0, 4), np.int32),
        binding_weight=np.zeros((0, 4), np.float32),
        controller_points=controller,
        controller_springs=pairs,
        controller_rest_length=lengths,
    )
    names = ("fabric", "leather")
    distributions = [0.1 / 9 * np.ones(10) + (0.9 - 0.1 / 9) * np.eye(10)[MATERIALS.index(n)] for n in names]
    priors = tuple(MaterialPrior(d / d.sum(), combine(d / d.sum(), "solid"), "solid") for d in distributions)
    times = np.arange(frames) / 30.0
    path = lift * (1.0 - np.cos(np.pi * np.minimum(times / 0.4, 1.0))) / 2.0
    controls = controller + (path[:, None, None] * np.array([0.3, 0.0, 1.0])).astype(np.float32)
    surface = points[rng.permutation(len(points))[:40]] + rng.uniform(-0.004, 0.004, (40, 3)).astype(
        np.float32
    )
    still = Observation(times, np.repeat(surface[None], frames, 0), controls.astype(np.float32), 0.0)
    case = Case(
        name=name or f"bar-{seed}-lift",
        object_name=f"bar-{seed}",
        object_class="foam",
        interaction="lift",
        shape_class="solid",
        topology=topology,
        priors=priors,
        observation=still,
        rest=surface.astype(np.float32),
        anchors=anchor(surface, points, springs),
        split=max(2, int(0.7 * frames)),
    )
    sure = tuple(
        replace(p, properties={**p.properties, "stiffness": Estimate(m, 0.1, "Pa")})
        for p, m in zip(priors, modulus, strict=True)
    )
    parameters = PriorMeanPredictor().from_priors(topology, sure, "solid", still.gravity, 0.0)
    complete = replay(case, parameters)
    seen = complete + rng.normal(0.0, noise, complete.shape).astype(np.float32) if noise else complete
    values = {k: v.value for k, v in parameters.globals.items()}
    truth = Truth(
        material=np.array([MATERIALS.index(n) for n in names]),
        modulus=np.array(modulus, np.float64),
        dashpot_damping=float(values["dashpot_damping"]),
        drag_rate=float(values["drag_rate"]),
        friction=float(values["friction"]),
        restitution=float(values["restitution"]),
    )
    return replace(
        case, observation=replace(still, points=seen.astype(np.float32)), complete=complete, truth=truth
    )
