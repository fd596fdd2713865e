"""What a hand did is told from what was measured of it."""

from collections.abc import Callable

import numpy as np
import pytest
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from model.gap.bodies.hand import LOUDEST, _roughness, _smoothed, steadied
from model.types import Array

Noisy = Callable[[Float64[Array, "T C 3"], float, float, int], Float64[Array, "T C 3"]]
TIMES = np.arange(136) / 30.0


def reached(times: Float64[Array, " T"]) -> Float64[Array, "T C 3"]:
    """Four points of a hand that reaches for something without a jerk, and turns to and fro."""
    share = np.clip((times - 0.5) / 1.2, 0.0, 1.0)
    way = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    turn = Rotation.from_rotvec(np.outer(0.3 * np.sin(2.0 * times), [0.0, 1.0, 0.0]))
    corners = 0.02 * np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 1.0]])
    held = np.stack([turn.apply(corner) for corner in corners], axis=1)
    return held + np.outer(way, [0.3, 0.1, 0.2])[:, None]


def moved(places: Float64[Array, "T C 3"]) -> Float64[Array, "T C 3"]:
    return places - places.mean(0)


@pytest.mark.parametrize("memory", [0.0, 0.5])
@pytest.mark.parametrize("seed", range(3))
def test_noise_is_taken_off_and_most_of_all_what_it_shakes_with(
    memory: float, seed: int, noisy: Noisy
) -> None:
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


def test_a_jolt_stays_as_it_was_measured(noisy: Noisy) -> None:
    jolted = noisy(reached(TIMES), 1e-4, 0.0, 0)
    jolted[70:] += [0.1, 0.0, 0.0]
    assert (steadied(jolted, TIMES) == jolted).all()


def test_a_jolt_of_centimetres_stays_beside_noise_of_a_millimetre(noisy: Noisy) -> None:
    jolted = noisy(reached(TIMES), 0.001, 0.0, 4)
    jolted[70:] += [0.05, 0.0, 0.0]
    assert np.abs(np.diff(steadied(jolted, TIMES), axis=0)[69, :, 0]).min() > 0.04


@pytest.mark.parametrize("frequency", [5.0, 6.0, 8.0])
@pytest.mark.parametrize("size", [0.0, 0.001])
def test_a_fast_shake_is_no_noise(frequency: float, size: float, noisy: Noisy) -> None:
    true = reached(TIMES)
    true[..., 0] += 0.03 * np.sin(2.0 * np.pi * frequency * TIMES)[:, None]
    measured = noisy(true, size, 0.0, 5)
    off = steadied(measured, TIMES) - measured
    assert np.sqrt(np.square(off).mean()) < LOUDEST


def test_a_lively_hand_is_smoothed_less_than_a_slow_one(noisy: Noisy) -> None:
    slow, lively = (0.05 * np.sin(rate * TIMES)[:, None, None] * np.ones((1, 4, 3)) for rate in (1.0, 12.0))
    off = [
        float(np.square(np.diff(steadied(noisy(true, 0.001, 0.0, 6), TIMES) - true, axis=0)).mean())
        for true in (slow, lively)
    ]
    assert off[0] < 0.5 * off[1] < 0.5 * 2e-6, "what is left of the noise in what moves from frame to frame"


@pytest.mark.parametrize("memory", [0.0, 0.4])
def test_the_likelihood_is_that_of_all_frames_at_once(memory: float) -> None:
    """Against matrices without any structure, for uneven frames, up to what no ratio changes."""
    rng = np.random.default_rng(7)
    times = np.cumsum(rng.uniform(0.02, 0.06, 12))
    series, bands = rng.normal(size=(12, 2)), _roughness(times)
    rough = sum(np.diag(band[: 12 - k], -k) for k, band in enumerate(bands))
    rough = rough + np.tril(rough, -1).T
    noise = memory ** np.abs(np.subtract.outer(np.arange(12), np.arange(12))) if memory else np.eye(12)
    basis = np.stack([times**k for k in range(3)], 1)
    nought = np.linalg.svd(basis.T)[2][3:].T
    inner = np.linalg.inv(nought.T @ rough @ nought)

    def dense(ratio: float) -> float:
        spread = nought.T @ noise @ nought + inner / ratio
        projected = nought.T @ series
        square = float(np.einsum("ij,ik,kj->", projected, np.linalg.inv(spread), projected)) / 2
        return 9.0 * np.log(square) + float(np.linalg.slogdet(spread)[1])

    found = [_smoothed(series, bands, ratio, memory).unlikely for ratio in (0.1, 1.0, 30.0)]
    expected = [dense(ratio) for ratio in (0.1, 1.0, 30.0)]
    assert np.allclose(np.diff(found), np.diff(expected), atol=1e-6)


def test_frames_at_nearly_the_same_time_are_left_alone(noisy: Noisy) -> None:
    times = TIMES.copy()
    times[50] = times[49] + 1e-9
    measured = noisy(reached(times), 0.001, 0.0, 8)
    assert (steadied(measured, times) == measured).all()


def test_frames_that_are_missing_do_not_bend_the_path(noisy: Noisy) -> None:
    measured = noisy(reached(TIMES), 0.001, 0.0, 1)
    kept = np.delete(np.arange(len(TIMES)), [40, 41, 42, 43, 80])
    whole, some = steadied(measured, TIMES), steadied(measured[kept], TIMES[kept])
    assert np.abs(moved(some) - moved(whole[kept])).max() < 0.003


def test_the_first_frame_is_as_measured(noisy: Noisy) -> None:
    measured = noisy(reached(TIMES), 0.001, 0.0, 2)
    assert np.allclose(steadied(measured, TIMES)[0], measured[0], atol=1e-12)


def test_a_turned_and_shifted_hand_moves_alike(noisy: Noisy) -> None:
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
