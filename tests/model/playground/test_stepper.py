from dataclasses import replace

import numpy as np
import pytest
import torch

from model.playground import stepper
from model.playground.stepper import Stepper
from model.simulator.divergence import SimulationDiverged


def stepped(bundle, frames):
    simulator = bundle.simulator()
    motion = torch.from_numpy(bundle.controls)
    moving = Stepper(simulator, simulator.rest_state(), motion[0], 1 / 30)
    places = [moving.state.positions.numpy()]
    for frame in range(1, frames):
        moving.advance(motion[min(frame, len(motion) - 1)], 1 / 30)
        places.append(moving.state.positions.numpy())
    return np.stack(places)


def test_frame_by_frame_it_is_a_rollout(plain_twin):
    expected = plain_twin.rollout().points
    np.testing.assert_allclose(stepped(plain_twin, len(expected)), expected, atol=1e-6)


def test_it_goes_on_when_its_memory_of_the_motion_is_full(plain_twin, monkeypatch):
    whole = stepped(plain_twin, 12)
    monkeypatch.setattr(stepper, "FRAMES", 4)
    np.testing.assert_allclose(stepped(plain_twin, 12), whole, atol=1e-4)


def test_points_that_run_into_each_other_are_stopped(twin):
    simulator = twin.simulator()
    start = simulator.rest_state()
    inward = start.positions.mean(0) - start.positions
    falling = replace(start, velocities=20.0 * inward)
    free = replace(twin, parameters=replace(twin.parameters, globals={})).simulator()

    def closest(simulator):
        moving = Stepper(simulator, falling, twin_places(simulator), 1 / 30)
        nearest = np.inf
        for _ in range(10):
            moving.advance(twin_places(simulator), 1 / 120)
            apart = torch.pdist(moving.state.positions)
            nearest = min(nearest, float(apart.min()))
        return nearest

    assert closest(simulator) > closest(free)


def twin_places(simulator):
    return simulator.system.controller_points


def test_what_laws_remember_outlives_a_rebuild(plain_twin, effect):
    bundle = replace(plain_twin, effects=(effect("plasticity"),))
    simulator = bundle.simulator()
    places = simulator.system.controller_points
    moving = Stepper(simulator, simulator.rest_state(), places, 1 / 30)
    moving.advance(places + torch.tensor([0.3, 0.0, 0.0]), 1 / 30)
    ((name, kept),) = moving.state.memory.items()
    again = Stepper(bundle.simulator(), moving.state, places, 1 / 30)
    torch.testing.assert_close(again.state.memory[name], kept)
    assert float(kept.abs().max()) > 0
    fresh = replace(moving.state, memory={name: kept[:-2] + 1.0})
    fewer = Stepper(bundle.simulator(), fresh, places, 1 / 30).state.memory[name]
    torch.testing.assert_close(fewer[:-2], kept[:-2] + 1.0)


def test_what_leaves_the_numbers_is_said(plain_twin):
    simulator = plain_twin.simulator()
    start = replace(simulator.rest_state(), velocities=torch.full((27, 3), float("nan")))
    moving = Stepper(simulator, start, simulator.system.controller_points, 1 / 30)
    with pytest.raises(SimulationDiverged):
        moving.advance(simulator.system.controller_points, 1 / 30)
