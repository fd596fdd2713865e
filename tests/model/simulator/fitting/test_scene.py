"""Parameters of a scene by name: the terms', the system's, the start and the controllers."""

import numpy as np
import pytest
import torch

from model.errors import InputError
from model.simulator.fitting.scene import Scene
from model.simulator.forces.dashpot import Dashpot
from model.simulator.forces.unprojected_dashpot import UnprojectedDashpot
from model.simulator.system import State


def test_every_constant_is_reached_and_the_rest_is_shared(block):
    scene = block()
    other = scene.with_values(
        {
            "spring.stiffness": torch.tensor(7.0),
            "dashpot.dashpot_damping": torch.tensor(0.3),
            "ground.friction": torch.tensor(0.9),
            "system.mass": torch.tensor(0.5),
        }
    )
    assert float(other.value("spring.stiffness").detach()) == pytest.approx(7.0)
    assert float(other.value("dashpot.dashpot_damping").detach()) == pytest.approx(0.3)
    assert float(other.value("ground.friction").detach()) == pytest.approx(0.9)
    assert float(other.value("system.mass").detach()) == pytest.approx(0.5)
    assert float(scene.value("ground.friction").detach()) == pytest.approx(0.4)
    assert other.simulator.system.edges is scene.simulator.system.edges
    assert list(other.simulator.forces) == list(scene.simulator.forces)
    assert other.simulator.backend == scene.simulator.backend


def test_gradients_reach_the_callers_leaves(chain):
    names = ["spring.stiffness", "system.mass", "state.velocities", "controls.offset", "system.rest_length"]
    scene = chain(frames=3)
    leaves = {name: scene.value(name).detach().clone().requires_grad_() for name in names}
    loss = scene.with_values(leaves).rollout(substeps=80).points.square().sum()
    for name, gradient in zip(names, torch.autograd.grad(loss, list(leaves.values())), strict=True):
        assert float(gradient.norm()) > 0, name


def test_the_start_and_the_controllers(chain):
    scene = chain(frames=4)
    moved = scene.with_values(
        {"state.velocities": torch.tensor([1.0, 0.0, 0.0]), "controls.offset": torch.tensor([0.0, 0.0, 0.1])}
    )
    assert moved.state.velocities.shape == (8, 3)
    assert float(moved.state.velocities[5, 0]) == 1.0
    torch.testing.assert_close(moved.state.positions, scene.simulator.system.points)
    assert moved.controls.shape == (4, 1, 3)
    assert float(moved.controls[2, 0, 2] - scene.simulator.system.controller_points[0, 2]) == pytest.approx(
        0.1
    )
    shifted = scene.with_values({"state.positions": scene.simulator.system.points + 1.0})
    assert isinstance(shifted.state, State)
    assert float(shifted.state.velocities.abs().max()) == 0.0


def test_terms_that_were_added(chain):
    scene = chain()
    more = Scene(scene.simulator.with_force(UnprojectedDashpot(0.2)), scene.times)
    name = f"{UnprojectedDashpot.name}.dashpot_damping"
    assert float(more.with_values({name: torch.tensor(0.7)}).value(name).detach()) == pytest.approx(0.7)


def test_names_that_there_are_not(block):
    scene = block()
    with pytest.raises(
        InputError, match=r"no parameter 'spring.damping': it has .*spring.stiffness.*state.po"
    ):
        scene.value("spring.damping")
    with pytest.raises(InputError, match=r"no parameter 'wind.speed'"):
        scene.with_values({"wind.speed": torch.tensor(1.0)})
    with pytest.raises(InputError, match=r"controls.offset has nothing to move"):
        scene.with_values({"controls.offset": torch.zeros(3)})


def test_a_shorter_look(chain):
    scene = chain(frames=6)
    whole, part = scene.rollout(substeps=80), scene.rollout(3, substeps=80)
    assert part.points.shape[0] == 3
    assert torch.equal(part.points, whole.points[:3])
    np.testing.assert_array_equal(part.times, scene.times[:3])
    assert Dashpot.name in scene.simulator.forces
