import math

import numpy as np

from model.evaluation.baselines.evolution import Axis, evolve

AXES = [Axis("x", 0.0, -2.0, 2.0), Axis("y", 5.0, 0.0, 10.0), Axis("z", 0.0, 0.0, 1.0)]


def _bowl(at):
    return (at["x"] - 1.0) ** 2 + (at["y"] - 2.0) ** 2 + at["z"]


def test_it_finds_the_bottom_of_a_bowl_at_a_bound():
    best, least = evolve(AXES, _bowl, generations=40, population=None, seed=3)
    assert abs(best["x"] - 1.0) < 0.05
    assert abs(best["y"] - 2.0) < 0.05
    assert least == _bowl(best) < 0.02


def test_the_same_seed_finds_the_same_and_numpy_is_left_alone():
    np.random.seed(7)  # noqa: NPY002
    state = np.random.get_state()[1].copy()  # noqa: NPY002
    runs = [evolve(AXES, _bowl, generations=5, population=6, seed=seed)[0] for seed in (1, 1, 2)]
    assert runs[0] == runs[1] != runs[2]
    assert np.array_equal(state, np.random.get_state()[1])  # noqa: NPY002


def test_what_is_not_finite_is_never_the_best():
    best, least = evolve(
        AXES, lambda at: math.inf if at["x"] > 0 else at["x"], generations=10, population=8, seed=0
    )
    assert best["x"] <= 0.0
    assert np.isfinite(least)


def test_without_generations_the_start_remains():
    best, least = evolve(AXES, _bowl, generations=0, population=None, seed=0)
    assert best == {"x": 0.0, "y": 5.0, "z": 0.0}
    assert least == 10.0
