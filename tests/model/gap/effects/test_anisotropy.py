"""Springs at angles to the fibres, against the law as it is written."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from model.gap.effects.anisotropy import Anisotropy
from model.simulator.build import build_simulator

ANGLES = np.deg2rad([0.0, 30.0, 45.0, 60.0, 90.0])


@pytest.fixture
def fan(block):
    """Springs from one point in all these directions."""
    ends = 0.1 * np.stack([np.cos(ANGLES), np.sin(ANGLES), 0 * ANGLES], -1)
    simulator = build_simulator(
        points=np.concatenate([np.zeros((1, 3)), ends]),
        mass=np.full(6, 0.01),
        springs=np.stack([np.zeros(5, np.int64), np.arange(1, 6)], -1),
        rest_length=np.full(5, 0.1),
        stiffness=20.0,
    )
    return replace(block, simulator=simulator, controls=None)


@pytest.mark.parametrize("sharpness", [1.0, 2.0, 4.5])
@pytest.mark.parametrize("azimuth", [0.0, np.pi / 4])
def test_a_spring_is_stiffer_by_how_far_it_lies_along_the_fibres(fan, sharpness, azimuth):
    values = {"excess": 3.0, "azimuth": azimuth, "elevation": 0.0, "sharpness": sharpness}
    known = {name: torch.tensor(value, dtype=torch.float64) for name, value in values.items()}
    alignment = Anisotropy().apply(fan, known).simulator.force("anisotropy").value("alignment")
    expected = np.abs(np.cos(ANGLES - azimuth)) ** (2.0 * sharpness)
    np.testing.assert_allclose(alignment.numpy(), expected, rtol=1e-6, atol=1e-12)


def test_no_spring_lies_along_fibres_that_stand_on_it(fan):
    values = {"excess": 3.0, "azimuth": 0.3, "elevation": np.pi / 2, "sharpness": 1.0}
    known = {name: torch.tensor(value, dtype=torch.float64) for name, value in values.items()}
    alignment = Anisotropy().apply(fan, known).simulator.force("anisotropy").value("alignment")
    np.testing.assert_allclose(alignment.numpy(), 0.0, atol=1e-12)


@pytest.mark.parametrize("angle", np.linspace(-3.1, 3.1, 9))
def test_turned_fibres_are_the_same_axis_far_from_the_bounds(fan, angle):
    """A fibre has two ends: a fit that begins with the one beside a bound could not turn it past that."""
    effect = Anisotropy()
    values = {"excess": 3.0, "azimuth": 1.05, "elevation": 0.9, "sharpness": 2.0}
    turned = effect.turned(values, angle)
    assert abs(turned["azimuth"]) <= np.pi / 2 + 1e-9
    found, expected = (
        effect.apply(fan, {name: torch.tensor(value, dtype=torch.float64) for name, value in each.items()})
        for each in (turned, {**values, "azimuth": values["azimuth"] + angle})
    )
    torch.testing.assert_close(
        *(world.simulator.force("anisotropy").value("alignment") for world in (found, expected)),
        atol=1e-9,
        rtol=1e-9,
    )


@pytest.mark.parametrize(("excess", "sharpness"), [(0.7, 2.0), (11.2, 2.0), (3.0, 5.0)])
def test_beside_its_fibres_a_body_is_as_stiff_on_average_as_it_was(excess, sharpness):
    values = {"excess": excess, "azimuth": 0.4, "elevation": 0.3, "sharpness": sharpness}
    ways = np.random.default_rng(0).normal(size=(200_000, 3))
    along = np.abs(ways[:, 0] / np.linalg.norm(ways, axis=1)) ** (2.0 * sharpness)
    softer = Anisotropy().beside(values)["stiffness"]
    assert softer * (1.0 + excess * along).mean() == pytest.approx(1.0, rel=0.02)
