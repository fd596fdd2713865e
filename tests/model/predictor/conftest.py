"""Small cases: their samples with motion that somebody might have seen, and a folder of them on disk."""

from collections.abc import Callable
from pathlib import Path
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


@pytest.fixture(scope="session")
def case_folder(make_case, tmp_path_factory) -> Path:
    """Cases of five objects, each a bar of two parts that is lifted, with an index."""
    from model.scenes.files import save_case, write_index

    folder = tmp_path_factory.mktemp("cases")
    rng = np.random.default_rng(0)
    for seed in range(5):
        modulus = tuple(np.exp(rng.uniform(np.log(2e3), np.log(4e4), 2)).tolist())
        case = make_case(seed=seed, modulus=modulus, frames=10, noise=5e-4)
        save_case(case, folder / f"{case.name}.case.npz")
    write_index(folder, seed=0)
    return folder


@pytest.fixture(scope="session")
def trained(case_folder, tmp_path_factory):
    """A run of two epochs of the quick configuration."""
    from tests.model.predictor.quick import fit

    out = tmp_path_factory.mktemp("trained")
    assert fit(case_folder, out, epochs=2) == 0
    return out / "run-0"
