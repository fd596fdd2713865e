"""Samples of small cases, with motion that somebody might have seen."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest

if TYPE_CHECKING:
    from model.predictor.sample import Sample
    from model.scenes.case import Case

MOTION_DIM, GLOBAL_DIM = 5, 3


@pytest.fixture(scope="session")
def sample_of() -> "Callable[..., Sample]":
    """`sample_of(case, seed=…)`: its sample, with motion features drawn by the seed, per mass point."""

    def make(case: "Case", seed: int = 0, points: np.ndarray | None = None) -> "Sample":
        from model.predictor.motion_features import MotionFeatures
        from model.predictor.sample import make_sample

        rng = np.random.default_rng(seed)
        drawn = rng.normal(size=(len(case.topology.points), MOTION_DIM)).astype(np.float32)
        whole = rng.normal(size=GLOBAL_DIM).astype(np.float32)
        motion = MotionFeatures(drawn if points is None else points, whole)
        seen = case.observation
        ground = seen.ground_height
        return make_sample(case.topology, case.priors, case.shape_class, seen.gravity, ground, motion)

    return make
