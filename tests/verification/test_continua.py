"""Chains of many springs against the continua they stand for."""

import math

import numpy as np
import pytest
import torch
from scipy.optimize import brentq

from model.simulator.forces.controller import ControllerSpring
from model.simulator.forces.dashpot import Dashpot
from model.simulator.forces.drag import Drag
from model.simulator.forces.gravity import Gravity
from model.simulator.forces.spring import Spring
from model.simulator.simulator import Simulator
from model.simulator.system import State


def elastic_catenary(span, length, weight, modulus, s):
    """Places along a cable hung level, at unstretched lengths s (Irvine 1981, Cable structures)."""
    half = weight * length / 2

    def x(pull, s):
        swing = np.arcsinh(half / pull) - np.arcsinh((half - weight * s) / pull)
        return pull * s / modulus + pull / weight * swing

    pull = brentq(lambda pull: x(pull, length) - span, 1e-3, 1e3)
    tension = np.sqrt(pull**2 + half**2) - np.sqrt(pull**2 + (half - weight * s) ** 2)
    z = -s / modulus * (half - weight * s / 2) - tension / weight
    return np.stack([x(pull, s), np.zeros_like(s), z], axis=1)


def test_hanging_chain(chain):
    """Let go from a straight line, a damped chain comes to rest on the elastic catenary.

    n links stand for the cable to O(1/n²); of the way to rest exp(-ωt) is left, here under 1e-3 of the sag.
    """
    count, length, span, mass = 24, 1.0, 0.8, 0.5
    spacing, stiffness = length / (count - 1), 1000.0
    system = chain(count, spacing, mass / (count - 1), held=True)
    forces = [Spring(stiffness), ControllerSpring(4e3), Dashpot(0.1), Drag(8.0), Gravity()]
    start = system.points * torch.tensor([span / length, 1.0, 1.0])
    ends = system.points[[0, -1]] * torch.tensor([span / length, 1.0, 1.0])
    still = State(start, torch.zeros_like(start))
    end = Simulator(system, forces).rollout(still, ends.expand(2, -1, -1), fps=0.5, substeps=700).end
    # half a link at each end hangs on the grip: the cable between the outer points carries all the rest
    along = np.arange(count) * spacing
    places = (end.positions - end.positions[0]).numpy()  # the grips give a little
    cable = elastic_catenary(places[-1, 0], length, mass * 9.81 / length, stiffness * spacing, along)
    sag = -cable[:, 2].min()
    assert sag > 0.2
    assert np.abs(places - cable).max() < 2 / count**2 * sag


def test_wave_speed_in_a_bar(chain):
    """A pulse runs at √(E/ρ): for springs k and masses m spaced by a, E/ρ = k a² / m.

    Dispersion of a pulse of width w slows it by (a/w)²/8 and less; time stepping by less still.
    """
    count, spacing, mass, stiffness, width = 160, 0.01, 0.002, 500.0, 0.08
    speed = spacing * math.sqrt(stiffness / mass)
    system = chain(count, spacing, mass)
    x = system.points[:, 0]
    bump = 1e-4 * torch.exp(-(((x - 0.4) / width) ** 2) / 2)
    moving = torch.zeros_like(system.points)
    moving[:, 0] = bump * (x - 0.4) / width**2 * speed  # a travelling wave: u_t = -c u_x
    placed = system.points.clone()
    placed[:, 0] += bump
    duration = 0.8 / speed
    rollout = Simulator(system, [Spring(stiffness)]).rollout(
        State(placed, moving), frames=2, fps=1 / duration, substeps=400
    )
    after = rollout.points[-1, :, 0] - x
    centre = float((after**2 * x).sum() / (after**2).sum())
    assert (centre - 0.4) / duration == pytest.approx(speed, rel=(spacing / width) ** 2 / 8)
    assert float(after.max()) == pytest.approx(1e-4, rel=0.02)
