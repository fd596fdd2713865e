"""What a hand did is told from what was measured of it."""

import numpy as np
import pytest
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from model.gap.bodies.hand import steadied
from model.types import Array

TIMES = np.arange(136) / 30.0


def reached(times: Float64[Array, " T"]) -> Float64[Array, "T C 3"]:
    """Four points of a hand that reaches for something without a jerk, and turns to and fro."""
    share = np.clip((times - 0.5) / 1.2, 0.0, 1.0)
    way = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    turn = Rotation.from_rotvec(np.outer(0.3 * np.sin(2.0 * times), [0.0, 1.0, 0.0]))
    corners = 0.02 * np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 1.0]])
    held = np.stack([turn.apply(corner) for corner in corners], axis=1)
    return held + np.outer(way, [0.3, 0.1, 0.2])[:, None]


def noisy(places: Float64[Array, "T C 3"], size: float, memory: float, seed: int) -> Float64[Array, "T C 3"]:
    noise = np.random.default_rng(seed).normal(size=places.shape)
    for t in range(1, len(noise)):
        noise[t] = memory * noise[t - 1] + np.sqrt(1.0 - memory**2) * noise[t]
    return places + size * noise


def moved(places: Float64[Array, "T C 3"]) -> Float64[Array, "T C 3"]:
    return places - places.mean(0)


@pytest.mark.parametrize("memory", [0.0, 0.5])
@pytest.mark.parametrize("seed", range(3))
def test_noise_is_taken_off_and_most_of_all_what_it_shakes_with(memory: float, seed: int) -> None:
    true = reached(TIMES)
    measured = noisy(true, 0.0015, memory, seed)
    found = steadied(measured.astype(np.float32), TIMES)

    def off(places: Float64[Array, "T C 3"], order: int) -> float:
        return float(np.square(np.diff(moved(places) - moved(true), order, axis=0)).mean() ** 0.5)

    assert off(found, 0) < 0.9 * off(measured, 0)
    assert off(found, 2) < 0.3 * off(measured, 2)


def test_motion_without_noise_stays_as_it_is() -> None:
    true = reached(TIMES)
    assert np.abs(steadied(true, TIMES) - true).max() < 1e-4


def test_a_jolt_stays_as_it_was_measured() -> None:
    jolted = noisy(reached(TIMES), 1e-4, 0.0, 0)
    jolted[70:] += [0.1, 0.0, 0.0]
    assert (steadied(jolted, TIMES) == jolted).all()


def test_frames_that_are_missing_do_not_bend_the_path() -> None:
    measured = noisy(reached(TIMES), 0.001, 0.0, 1)
    kept = np.delete(np.arange(len(TIMES)), [40, 41, 42, 43, 80])
    whole, some = steadied(measured, TIMES), steadied(measured[kept], TIMES[kept])
    assert np.abs(moved(some) - moved(whole[kept])).max() < 0.003


def test_the_first_frame_is_as_measured() -> None:
    measured = noisy(reached(TIMES), 0.001, 0.0, 2)
    assert np.allclose(steadied(measured, TIMES)[0], measured[0], atol=1e-12)


def test_a_turned_and_shifted_hand_moves_alike() -> None:
    measured = noisy(reached(TIMES), 0.001, 0.3, 3)
    turn = Rotation.from_rotvec([0.0, 0.0, 0.7]).as_matrix()
    elsewhere = steadied(measured @ turn.T + [1.0, -2.0, 0.0], TIMES)
    assert np.allclose(elsewhere, steadied(measured, TIMES) @ turn.T + [1.0, -2.0, 0.0], atol=1e-9)


@pytest.mark.parametrize(("frames", "count"), [(6, 3), (136, 0)])
def test_little_is_left_as_it_is(frames: int, count: int) -> None:
    measured = np.random.default_rng(0).normal(size=(frames, count, 3))
    assert (steadied(measured, TIMES[:frames]) == measured).all()


def test_a_hand_that_does_not_move_does_not_move() -> None:
    still = np.full((136, 2, 3), 0.3)
    assert np.allclose(steadied(still, TIMES), still, atol=1e-12)
