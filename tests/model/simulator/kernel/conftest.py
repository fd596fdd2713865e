"""A scene with everything that a kernel has, every constant a leaf, and what the oracle makes of it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from model.simulator.build import build_simulator
from model.simulator.kernel import build
from model.simulator.kernel.cuda.kernel import CudaKernel
from model.simulator.kernel.cuda.module import Module
from model.simulator.simulator import Simulator
from model.simulator.system import State

POINTS, SPRINGS, CONTROLLERS = 61, 260, 3
DRIVER = Path(__file__).parent / "cuda" / "serial_driver.cpp"


@dataclass(frozen=True)
class Scene:
    """What to roll out, and from what."""

    simulator: Simulator
    leaves: dict[str, torch.Tensor]
    controls: torch.Tensor
    device: str = "cpu"

    def state(self):
        return State(*(self.leaves[name].to(self.device) for name in ("positions", "velocities")))

    def roll(self, backend, **options):
        """The rollout by a backend, and the gradients of a loss with a bit of everything in it."""
        chosen = {"fps": 50.0, "substeps": 40, **options}
        rollout = self.simulator.with_backend(backend).rollout(self.state(), self.controls, **chosen)
        weights = np.random.default_rng(5).normal(size=rollout.points.shape)
        weights = torch.from_numpy(weights).to(rollout.points)
        loss = (weights * rollout.points).sum() + 0.03 * (weights * rollout.velocities).sum()
        leaves = {name: leaf for name, leaf in self.leaves.items() if leaf.requires_grad}
        gradients = torch.autograd.grad(loss, list(leaves.values()), allow_unused=True)
        return rollout, dict(zip(leaves, gradients, strict=True))


@pytest.fixture
def scene():
    """Make a scene: a jiggled block falls on the ground and slides, held by springs to three controllers."""

    def build(dtype=torch.float64, forces=(), batch=(), ground=0.0):
        rng = np.random.default_rng(1)

        def leaf(value):
            return torch.tensor(np.asarray(value), dtype=dtype).requires_grad_()

        grid = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), -1).reshape(-1, 3)[:POINTS]
        points = 0.02 * grid + rng.uniform((-0.004, -0.004, 0.016), (0.004, 0.004, 0.024), (POINTS, 3))
        near = cKDTree(points).query(points, k=12)[1][:, 1:]
        pairs = np.unique(np.sort(np.stack([np.repeat(np.arange(POINTS), 11), near.ravel()], 1), 1), axis=0)
        pairs = pairs[rng.permutation(len(pairs))[:SPRINGS]]
        held = np.stack([np.repeat(np.arange(CONTROLLERS), 4), rng.integers(0, POINTS, 4 * CONTROLLERS)], 1)
        hands = points[rng.integers(0, POINTS, CONTROLLERS)] + [0, 0, 0.03]
        lengths = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
        leaves = {
            "mass": leaf(rng.uniform(0.001, 0.003, POINTS)),
            "rest_length": leaf(lengths * rng.uniform(0.95, 1.05, (*batch, len(pairs)))),
            "stiffness": leaf(rng.uniform(20, 60, (*batch, len(pairs)))),
            "controller_stiffness": leaf(rng.uniform(20, 60, len(held))),
            "controller_rest_length": leaf(np.linalg.norm(hands[held[:, 0]] - points[held[:, 1]], axis=1)),
            "dashpot_damping": leaf(rng.uniform(0.01, 0.03, (*batch, 1) if batch else ())),
            "drag_rate": leaf(2.0),
            "friction": leaf(0.3),
            "restitution": leaf(0.4),
            "gravity": leaf([0.5, 0.2, -9.81]),
        }
        simulator = build_simulator(
            points=points,
            springs=pairs,
            controller_springs=held,
            controller_points=hands,
            ground_height=ground,
            dtype=dtype,
            **leaves,
        )
        for force in forces:
            simulator = simulator.with_force(force)
        motion = hands + np.cumsum(rng.normal(0, 0.003, (4, CONTROLLERS, 3)), axis=0)
        leaves["positions"] = leaf(points)
        leaves["velocities"] = leaf(rng.normal((0.4, 0.0, -0.8), 0.3, points.shape))
        leaves["controls"] = leaf(motion)
        return Scene(simulator, leaves, leaves["controls"])

    return build


@pytest.fixture
def apart():
    """Largest relative difference between two tensors, by norm."""

    def measure(found, expected):
        return float(
            (found.detach().double() - expected.detach().double()).norm() / expected.detach().double().norm()
        )

    return measure


@pytest.fixture
def serial_driver():
    """Make a CUDA driver whose device is this processor, which knows the kernels of a text."""
    return lambda source: build.load(DRIVER.read_text().replace("// THE KERNELS", source))


@pytest.fixture
def serial(serial_driver):
    """A loader of CUDA kernels that this processor runs, one thread after the other."""
    return lambda source, device: Module(serial_driver(source), b"serial", device)


@pytest.fixture(params=["processor", "cuda text"])
def engine(request, monkeypatch, serial):
    """Which kernel a simulator gets: the processor's, or CUDA's with this processor as its device."""
    if request.param == "cuda text":
        monkeypatch.setattr(
            "model.simulator.backend.Kernel", lambda *terms: CudaKernel(*terms, loader=serial)
        )
    return request.param
