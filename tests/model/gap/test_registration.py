from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from model.errors import InputError
from model.gap.registration import moved_alike, onto_twin
from model.types import Observation

SPACING = 0.03


@pytest.fixture
def boot() -> np.ndarray:
    """An object that fits itself in one way alone: three bars of unequal length from one corner."""
    grid = SPACING * np.arange(12)
    bars = [np.outer(grid[: 3 + 4 * axis], np.eye(3)[axis]) for axis in range(3)]
    thick = [
        bar + SPACING * np.eye(3)[side] * (side != axis) for axis, bar in enumerate(bars) for side in range(3)
    ]
    return np.unique(np.concatenate([*bars, *thick]).round(6), axis=0) + np.array([0.1, 0.2, 0.3])


def seen(places: np.ndarray, **others) -> Observation:
    points = np.repeat(places[None].astype(np.float32), 4, axis=0)
    hand = np.repeat(places[None, :1].astype(np.float32) + np.float32(0.01), 4, axis=0)
    return Observation(times=np.arange(4) / 30, points=points, controllers=hand, **others)


def test_what_lies_on_the_twin_stays(boot):
    noise = np.random.default_rng(0).normal(0, 0.002, boot.shape)
    observation = seen(boot + noise)
    assert onto_twin(observation, boot, SPACING) is observation


@pytest.mark.parametrize("turn", [40.0, 170.0, -95.0])
def test_what_lies_elsewhere_is_moved_with_its_hand_and_ground(boot, turn):
    away = Rotation.from_euler("z", turn, degrees=True)
    noise = np.random.default_rng(0).normal(0, 0.002, boot.shape)
    there = away.apply(boot + noise) + np.array([1.0, -2.0, 0.5])
    observation = seen(there[::2], ground_height=0.4, gravity=(0.0, 0.0, -9.81))
    with pytest.warns(UserWarning, match="moved onto the twin"):
        moved = onto_twin(observation, boot, SPACING)
    assert np.abs(moved.points[0] - boot[::2]).max() < 0.01
    assert np.abs(moved.controllers[0, 0] - boot[0]).max() < 0.03
    assert moved.ground_height == pytest.approx(-0.1, abs=0.005)
    np.testing.assert_allclose(moved.gravity, (0, 0, -9.81), atol=1e-9)


def test_what_lies_on_its_side_takes_gravity_along(boot):
    away = Rotation.from_euler("x", 90.0, degrees=True)
    observation = seen(away.apply(boot))
    with pytest.warns(UserWarning, match="moved onto the twin"):
        moved = onto_twin(observation, boot, SPACING)
    assert np.abs(moved.points[0] - boot).max() < 0.005
    np.testing.assert_allclose(moved.gravity, away.inv().apply([0, 0, -9.81]), atol=0.05)
    on_ground = replace(observation, ground_height=0.0)
    with pytest.raises(InputError, match="lies 90° from how its twin does"):
        onto_twin(on_ground, boot, SPACING)


@pytest.mark.parametrize(
    ("factor", "line"),
    [(1000.0, "measures 413 m, the twin 0.413 m: another unit"), (0.1, "is it the twin of")],
)
def test_another_size_is_refused(boot, factor, line):
    with pytest.raises(InputError, match=line):
        onto_twin(seen(factor * boot), boot, SPACING)


def test_another_shape_is_refused(boot):
    sheet = np.stack(np.meshgrid(np.linspace(0, 0.4, 15), np.linspace(0, 0.3, 12)), -1).reshape(-1, 2)
    with pytest.raises(InputError, match="fits the twin nowhere"):
        onto_twin(seen(np.column_stack([sheet, np.ones(len(sheet))])), boot, SPACING)


def test_another_recording_is_moved_alike(boot):
    """What blew along x in both blows along the same way in both after it."""
    away = Rotation.from_euler("z", 40.0, degrees=True)
    first = seen(away.apply(boot) + np.array([1.0, -2.0, 0.5]), ground_height=0.4)
    other = seen(away.apply(boot + np.array([0.3, 0.0, 0.0])) + np.array([1.0, -2.0, 0.5]), ground_height=0.4)
    with pytest.warns(UserWarning, match="moved onto the twin"):
        moved = onto_twin(first, boot, SPACING)
    found = moved_alike(other, first, moved)
    np.testing.assert_allclose(found.points[0] - moved.points[0], boot * 0 + [0.3, 0.0, 0.0], atol=1e-5)
    assert found.ground_height == pytest.approx(moved.ground_height, abs=1e-6)
    assert moved_alike(other, first, first) is other
