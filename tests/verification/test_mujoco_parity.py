"""The same system in MuJoCo: slide joints, tendons between sites, its Euler step, its soft contact."""

import math

import numpy as np
import pytest

from model.simulator.contacts.ground import Ground
from model.simulator.forces.drag import Drag
from model.simulator.forces.gravity import Gravity

SHAPES = {"dumbbell": (2, 1, 1), "chain": (12, 1, 1), "sheet": (6, 6, 1), "block": (4, 4, 4)}
FPS = 30.0
TICKS = 12
"""Substeps within the time constant of a contact."""


@pytest.mark.parametrize("held", [True, False], ids=["handled", "free"])
@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_the_motion_is_mujocos_to_the_rounding(handled, peer, shape, held):
    """Both take the same step in float64, so they part by rounding alone.

    A step rounds each force to a few parts in 2^52; within the stability bound that is an error of the
    velocity of 4 eps size / dt at most, which n steps carry on and add up to 2 n² eps size. Ours takes the
    time between frames to a picosecond, which moves what moves by its speed.
    """
    body, steps = handled(shape, held=held), 60
    simulator = body.simulator(Gravity(), Drag(1.5))
    ours = simulator.rollout(body.start, body.controls, frames=4, fps=FPS, substeps=steps).points.numpy()
    theirs = body.by(peer("peers_mujoco").MujocoSprings(simulator, 1 / FPS / steps), 4, 1 / FPS, steps)
    assert np.abs(ours[-1] - ours[0]).max() > 0.02
    tolerance = 2 * (3 * steps) ** 2 * np.finfo(float).eps * np.abs(ours).max()
    tolerance += 3 * 1e-12 * FPS * np.abs(np.diff(ours, axis=0)).max()
    assert tolerance < 1e-10
    assert np.abs(theirs - ours).max() < tolerance


@pytest.mark.parametrize("backend", ["auto"], indirect=True)
@pytest.mark.parametrize("friction", [0.3, 2.0], ids=["slips", "sticks"])
@pytest.mark.parametrize(
    ("shape", "restitution"), [(None, 0.3), (None, 0.8), ((3, 3, 2), 0.05)], ids=["dull", "lively", "body"]
)
def test_the_ground_is_mujocos_as_its_contact_hardens(thrown, peer, shape, restitution, friction):
    """What ours does at once takes MuJoCo's spring and damper a moment (`delay`).

    So a bounce errs by the moment times the speeds before and after; the points bounce once, those of the
    body hardly. A contact four times as hard errs half as much or less.
    """
    module, body = peer("peers_mujoco"), thrown(shape, [0.5, 0.2, -0.6])
    simulator = body.simulator(Gravity(), contacts=[Ground(restitution, friction)])
    fall = float(body.start.positions[:, 2].max())
    speed = math.sqrt(float(body.start.velocities[0].square().sum()) + 2 * 9.81 * fall)
    errors = []
    for impact in (2e-3, 5e-4):
        steps = round(TICKS / impact / FPS)
        ours = simulator.rollout(body.start, frames=5, fps=FPS, substeps=steps).points.numpy()
        springs = module.MujocoSprings(simulator, 1 / FPS / steps, impact)
        errors.append(np.abs(body.by(springs, 5, 1 / FPS, steps) - ours).max())
        assert errors[-1] < speed * (1 + restitution) * delay(module, restitution, impact)
    assert errors[1] < errors[0] / 2


def delay(module, restitution, impact):
    """How long a contact lasts [s], by the formula of `soft_contact`."""
    ratio = module.soft_contact(restitution, impact)[1] * impact / 2
    arc = math.acos(ratio) if ratio < 1 else math.acosh(ratio)
    return 2 * impact * arc / math.sqrt(abs(1 - ratio**2))
