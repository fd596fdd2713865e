import numpy as np
import pytest

from model.predictor.stability import fastest, stable_step
from model.types import Topology


def pair(mass=(2.0, 2.0), held=False, chain=2):
    points = np.stack([np.arange(chain), 0 * np.arange(chain), 0 * np.arange(chain)], 1).astype(np.float32)
    springs = np.stack([np.arange(chain - 1), np.arange(1, chain)], axis=1).astype(np.int32)
    weights = np.resize(np.float32(mass), chain)
    grips = np.array([[0, 0]] if held else np.zeros((0, 2)), np.int32)
    return Topology(
        points,
        weights,
        springs,
        np.ones(chain - 1, np.float32),
        np.zeros(chain, np.int32),
        np.zeros((1, 1), np.int32),
        np.ones((1, 1), np.float32),
        np.float32([[-0.5, 0, 0]] if held else np.zeros((0, 3))),
        grips,
        np.full(len(grips), 0.5, np.float32),
    )


def test_two_masses_on_a_spring():
    found = fastest(pair((1.0, 4.0)), np.array([8.0]), np.zeros(0))
    assert found == pytest.approx(8.0 * (1 / 1.0 + 1 / 4.0))


def test_a_long_chain_approaches_four_k_over_m():
    found = fastest(pair(chain=60), np.full(59, 8.0), np.zeros(0))
    assert found == pytest.approx(4 * 8.0 / 2.0 * np.sin(np.pi * 59 / 120) ** 2, rel=2e-3)


def test_a_grip_adds_to_what_it_holds():
    free = fastest(pair(held=True), np.array([8.0]), np.array([0.0]))
    held = fastest(pair(held=True), np.array([8.0]), np.array([30.0]))
    expected = np.linalg.eigvalsh(np.array([[38.0, -8.0], [-8.0, 8.0]]) / 2.0)[-1]
    assert free == pytest.approx(8.0)
    assert held == pytest.approx(expected)


def test_the_step_is_the_root_of_the_bound():
    step = stable_step(400.0, 30.0)
    assert step**2 * 400.0 + 2 * step * 30.0 == pytest.approx(4.0)
    assert stable_step(400.0, 0.0) == pytest.approx(2.0 / 20.0)
