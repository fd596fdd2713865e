"""Scenes side by side move as they do alone, and gradients reach each scene's own parameters."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
import pytest
import torch

from model.errors import InputError
from model.simulator.batch import alike
from model.simulator.build import build_simulator
from model.simulator.forces.base import AxialForce
from model.simulator.forces.bending import Bending
from model.simulator.join import join
from model.simulator.parameters import Constant
from model.simulator.system import State

FRAMES, SUBSTEPS, FPS = (4, 6, 3), 12, 200.0


class Creep(AxialForce):
    """A law with memory and a constant of the whole scene."""

    name = "creep"
    constants: ClassVar[Mapping[str, Constant]] = {"rate_of_creep": Constant("1/s", "scene", (0.0, 10.0))}
    memory: ClassVar[Mapping[str, float]] = {"flow": 0.0}

    def __init__(self, rate_of_creep):
        super().__init__(rate_of_creep=rate_of_creep)

    @staticmethod
    def law(length, rest_length, rate_of_creep, flow, dt):
        strain = length / rest_length - 1.0 - flow
        return 3.0 * strain, flow + dt * rate_of_creep * strain


class Scene:
    """One of three: 5, 7 and 4 points; held, held by two, and free; on the ground but for the second."""

    def __init__(self, number, dtype=torch.float64):
        rng = np.random.default_rng(number)
        count, hands = ((5, 1), (7, 2), (4, 0))[number]
        points = rng.uniform(-0.05, 0.05, (count, 3)) + np.array([0.0, 0.0, 0.06])
        pairs = np.stack(np.triu_indices(count, 1), 1)

        def leaf(value):
            return torch.tensor(value, dtype=dtype, requires_grad=True)

        self.leaves = {
            "mass": leaf(rng.uniform(0.01, 0.02, count)),
            "rest_length": leaf(np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)),
            "stiffness": leaf(rng.uniform(20.0, 60.0, len(pairs)) if number else 30.0),
            "dashpot_damping": leaf(0.02 * (number + 1)),
            "drag_rate": leaf(1.0 + number),
            "gravity": leaf([0.3 * number, 0.0, -9.81 + number]),
        }
        held = np.stack([np.arange(hands), np.arange(hands)], 1)
        grip = dict(
            controller_springs=held,
            controller_rest_length=np.full(hands, 0.02),
            controller_stiffness=100.0 + number,
            controller_points=points[:hands] + np.array([0.0, 0.0, 0.02]),
        )
        if number != 1:
            self.leaves["friction"] = leaf(0.2 + 0.3 * number)
            self.leaves["restitution"] = leaf(0.1 + 0.3 * number)
        ground = None if number == 1 else -0.01 * number
        self.simulator = build_simulator(
            points=points,
            springs=pairs,
            dtype=dtype,
            ground_height=ground,
            **self.leaves,
            **(grip if hands else {}),
        )
        self.leaves["creep"] = leaf(2.0 + number)
        self.simulator = self.simulator.with_force(Creep(self.leaves["creep"]))
        if number == 2:
            self.leaves["bending"] = leaf(1e-3)
            rows = torch.tensor([[0, 1, 2], [1, 2, 3]])
            self.simulator = self.simulator.with_force(Bending(rows, self.leaves["bending"], 0.05))
        moved = np.cumsum(rng.normal(0, 0.002, (FRAMES[number], hands, 3)), 0) + grip["controller_points"]
        self.leaves["velocities"] = leaf(rng.normal((0.5, 0.0, -3.0), 0.3, points.shape))
        self.leaves["controls"] = leaf(moved)
        self.controls = self.leaves["controls"] if hands else None

    @property
    def state(self):
        rest = self.simulator.rest_state()
        return State(rest.positions, self.leaves["velocities"])

    def slopes(self, rollout):
        weights = torch.from_numpy(np.random.default_rng(9).normal(size=rollout.points.shape)).to(
            rollout.points
        )
        loss = (weights * rollout.points).sum() + 0.01 * (weights * rollout.velocities).sum()
        leaves = self.leaves.values()
        found = torch.autograd.grad(
            loss, list(leaves), allow_unused=True, retain_graph=True, materialize_grads=True
        )
        return dict(zip(self.leaves, found, strict=True))


@pytest.fixture
def scenes():
    return [Scene(number) for number in range(3)]


@pytest.mark.parametrize("backend", ["torch", "kernel"])
def test_scenes_side_by_side_move_as_they_do_alone(scenes, backend):
    joined = join([scene.simulator.with_backend(backend) for scene in scenes])
    assert joined.scene.tolist() == [0] * 5 + [1] * 7 + [2] * 4
    together = joined.rollout(
        [scene.state for scene in scenes],
        [scene.controls for scene in scenes],
        frames=FRAMES,
        fps=FPS,
        substeps=SUBSTEPS,
    )
    for number, (scene, found) in enumerate(zip(scenes, together, strict=True)):
        alone = scene.simulator.with_backend("torch").rollout(
            scene.state, scene.controls, frames=FRAMES[number], fps=FPS, substeps=SUBSTEPS
        )
        assert found.points.shape == alone.points.shape
        assert found.substeps == alone.substeps
        np.testing.assert_array_equal(found.times, alone.times)
        torch.testing.assert_close(found.points, alone.points, rtol=0, atol=1e-13)
        torch.testing.assert_close(found.velocities, alone.velocities, rtol=0, atol=1e-11)
        expected, slopes = scene.slopes(alone), scene.slopes(found)
        for name, slope in expected.items():
            scale = 1e-9 * float(slope.norm()) + 1e-12
            torch.testing.assert_close(slopes[name], slope, rtol=0, atol=scale, msg=name)
    touched = [float(each.points[..., 2].detach().min()) for each in together]
    assert touched[0] < 1e-3, "nothing touched the ground"
    assert touched[1] < -0.02, "what has no ground fell on one"


def test_one_known_gravity_stays_gravity(scenes):
    plain = [s.simulator for s in (Scene(0), Scene(1))]
    for simulator in plain:
        simulator.forces["gravity"] = simulator.force("gravity").with_values(gravity=(0.0, 0.0, -9.81))
    joined = join(plain)
    assert list(joined.simulator.forces)[:2] == ["spring", "controller_spring"]
    assert "gravity" in joined.simulator.forces
    assert "weight" in join([scene.simulator for scene in scenes]).simulator.forces


def test_substeps_are_those_of_the_scene_that_needs_most(scenes):
    stiff = scenes[0].simulator.force("spring").with_values(stiffness=1e6)
    simulators = [scenes[0].simulator.with_force(stiff), scenes[1].simulator]
    needed = [simulator.needed_substeps(1 / 30) for simulator in simulators]
    assert needed[0] > 2 * needed[1]
    assert join(simulators).simulator.needed_substeps(1 / 30) == pytest.approx(needed[0], abs=1)


def test_parameter_sets_of_joined_scenes(scenes):
    """A batch within a batch."""
    damping = torch.tensor([[0.01], [0.05]], dtype=torch.float64)
    sets = scenes[2].simulator.with_force(
        scenes[2].simulator.force("dashpot").with_values(dashpot_damping=damping)
    )
    both, _ = join([sets, Scene(2).simulator]).rollout(frames=[3, 3], fps=FPS, substeps=SUBSTEPS)
    assert both.points.shape == (3, 2, 4, 3)
    for number, value in enumerate(damping[:, 0]):
        one = scenes[2].simulator.force("dashpot").with_values(dashpot_damping=value)
        alone = scenes[2].simulator.with_force(one).rollout(frames=3, fps=FPS, substeps=SUBSTEPS)
        torch.testing.assert_close(both.points[:, number], alone.points, rtol=0, atol=1e-13)


def test_groups_that_may_share_substeps():
    assert alike([100, 67, 300, 90, 310]) == [[1, 3, 0], [2, 4]]
    assert alike([67, 101], waste=1.0) == [[0], [1]]
    assert alike([]) == []


def test_what_cannot_be_joined(scenes):
    first, second = scenes[0].simulator, scenes[1].simulator
    with pytest.raises(InputError, match="no scene to join"):
        join([])
    with pytest.raises(InputError, match="one data type"):
        join([first, Scene(1, torch.float32).simulator])
    del second.forces["drag"]
    with pytest.raises(InputError, match="scene 1 has no 'drag'"):
        join([first, second])
    collide = build_simulator(
        points=np.eye(3),
        mass=1.0,
        springs=np.zeros((0, 2)),
        rest_length=np.zeros(0),
        stiffness=1.0,
        collision_distance=0.1,
    )
    with pytest.raises(InputError, match="contact 'self_collision' cannot be joined"):
        join([collide, collide])
    remembers = join([scenes[0].simulator]).parts[0].rollout(frames=2).end
    with pytest.raises(InputError, match="with memory cannot be joined"):
        join([first]).state([remembers])
