"""The simulator of a bundle's arrays, against a reference in plain numpy that shares nothing with it."""

import numpy as np
import pytest
import torch

from model.errors import InputError
from model.simulator.build import build_simulator

pytestmark = pytest.mark.usefixtures("backend")

FPS, FRAMES = 30.0, 4
DAMPING, DRAG = 0.05, 0.8


@pytest.fixture
def arrays():
    """A jittered block of 27 points, its four top corners held."""
    rng = np.random.default_rng(1)
    grid = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), -1).reshape(-1, 3) * 0.03
    points = (grid + rng.uniform(-0.004, 0.004, grid.shape) + [0, 0, 0.25]).astype(np.float32)
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    springs = np.argwhere(np.triu((apart < 0.055) & (apart > 0))).astype(np.int32)
    top = np.argsort(-points[:, 2])[:4]
    return dict(
        points=points,
        mass=rng.uniform(0.002, 0.004, len(points)).astype(np.float32),
        springs=springs,
        rest_length=apart[springs[:, 0], springs[:, 1]],
        stiffness=rng.uniform(30, 150, len(springs)).astype(np.float32),
        controller_springs=np.stack([np.arange(4), top], 1).astype(np.int32),
        controller_rest_length=np.full(4, 0.02, np.float32),
        controller_stiffness=np.full(4, 200.0, np.float32),
        controller_points=points[top] + np.float32([0, 0, 0.02]),
        dashpot_damping=DAMPING,
        drag_rate=DRAG,
    )


@pytest.fixture
def controls(arrays):
    motion = np.repeat(arrays["controller_points"][None], FRAMES, 0)
    time = np.arange(FRAMES) / FPS
    motion[:, :, 0] += (0.05 * np.sin(2 * np.pi * 1.2 * time))[:, None]
    motion[:, :, 2] += (0.03 * time)[:, None]
    return motion


def reference(arrays, controls, substeps):
    """Semi-implicit Euler, spring by spring, as the equations are printed."""
    x, m = arrays["points"].astype(float), arrays["mass"].astype(float)[:, None]
    v, dt, frames = np.zeros_like(x), 1 / FPS / substeps, [x]
    ends, held = arrays["springs"], arrays["controller_springs"]
    for frame in range(len(controls) - 1):
        way = controls[frame + 1].astype(float) - controls[frame]
        for number in range(1, substeps + 1):
            force = np.zeros_like(x)
            pull = along(
                x[ends[:, 1]] - x[ends[:, 0]],
                v[ends[:, 1]] - v[ends[:, 0]],
                arrays["stiffness"],
                arrays["rest_length"],
            )
            np.add.at(force, ends[:, 0], pull)
            np.add.at(force, ends[:, 1], -pull)
            place = controls[frame] + way * number / substeps
            pull = along(
                place[held[:, 0]] - x[held[:, 1]], (way * FPS)[held[:, 0]] - v[held[:, 1]],
                arrays["controller_stiffness"], arrays["controller_rest_length"],
            )  # fmt: skip
            np.add.at(force, held[:, 1], pull)
            v = (v + dt * (force / m + [0, 0, -9.81])) * np.exp(-DRAG * dt)
            x = x + dt * v
        frames.append(x)
    return np.stack(frames)


def along(d, w, stiffness, rest_length):
    length = np.linalg.norm(d, axis=1)
    axis = d / length[:, None]
    return (stiffness * (length - rest_length) + DAMPING * (w * axis).sum(1))[:, None] * axis


def test_same_substeps_same_motion(arrays, controls):
    ours = build_simulator(**arrays, dtype=torch.float64).rollout(controls=controls, substeps=50)
    np.testing.assert_allclose(ours.points, reference(arrays, controls, 50), rtol=0, atol=1e-9)


def test_chosen_substeps_are_within_a_percent_of_the_limit(arrays, controls):
    ours = build_simulator(**arrays).rollout(controls=controls)
    assert ours.points.dtype == torch.float32
    limit = reference(arrays, controls, 1500)
    error = np.linalg.norm(ours.points.numpy() - limit, axis=-1).max()
    assert error < 0.01 * np.abs(limit - limit[0]).max()


def test_what_is_absent_does_not_act(arrays):
    bare = {name: arrays[name] for name in ("points", "mass", "springs", "rest_length", "stiffness")}
    simulator = build_simulator(**bare)
    assert list(simulator.forces) == ["spring", "dashpot", "gravity", "drag"]
    assert list(simulator.contacts) == []
    end = simulator.rollout(frames=3).points[-1]
    fallen = 9.81 / 2 * (2 / 30) ** 2
    np.testing.assert_allclose(arrays["points"][:, 2] - end[:, 2].numpy(), fallen, rtol=0.01)


def test_empty_controllers_are_no_controllers(arrays):
    arrays = {name: value[:0] if name.startswith("controller") else value for name, value in arrays.items()}
    assert "controller_spring" not in build_simulator(**arrays).forces


def test_contacts(arrays):
    made = build_simulator(
        **arrays, ground_height=0.1, collision_distance=0.01, friction=0.4, restitution=0.1
    )
    assert list(made.contacts) == ["self_collision", "ground"]  # the ground has the last word
    assert list(build_simulator(**arrays, collision_distance=0.0).contacts) == []


def test_zigzags_die_out_where_that_is_asked_for(arrays):
    assert "bending_damping" not in build_simulator(**arrays, bending_decay=0.0).forces
    count = 6
    row = np.stack([0.01 * np.arange(count), np.zeros(count), np.zeros(count)], -1)
    made = build_simulator(
        points=row,
        mass=np.full(count, 0.02),
        springs=np.stack([np.arange(count - 1), np.arange(1, count)], -1),
        rest_length=np.full(count - 1, 0.01),
        stiffness=np.full(count - 1, 100.0),
        bending_decay=50.0,
    )
    damping = made.force("bending_damping").value("bending_damping")
    np.testing.assert_allclose(damping.numpy(), 50.0 / 16 * 0.02 * 0.01**2, rtol=1e-5)


def test_an_object_without_three_points_in_a_row_has_none_that_die_out(arrays):
    """It moves as it does without."""
    pair = dict(
        points=np.array([[0.0, 0, 0], [0.01, 0, 0]]),
        mass=np.full(2, 0.02),
        springs=np.array([[0, 1]]),
        rest_length=np.full(1, 0.02),
        stiffness=np.full(1, 100.0),
    )
    plain, damped = (build_simulator(**pair, bending_decay=rate).rollout(frames=4) for rate in (0.0, 50.0))
    assert torch.equal(damped.points, plain.points)


def test_controllers_without_places_need_controls(arrays):
    del arrays["controller_points"]
    with pytest.raises(InputError, match="no rest places of them: give controls"):
        build_simulator(**arrays).rollout(frames=2)


def test_gradients_reach_a_prediction(arrays, controls):
    """A predictor's output goes in as it is, and gets its gradient."""
    raw = torch.zeros(len(arrays["springs"]), requires_grad=True)
    stiffness = 50.0 * raw.exp()
    simulator = build_simulator(**{**arrays, "stiffness": stiffness})
    (simulator.rollout(controls=controls[:2]).points[-1] ** 2).sum().backward()
    assert (raw.grad != 0).all()
