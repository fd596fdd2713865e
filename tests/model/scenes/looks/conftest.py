import numpy as np
import pytest

from model.types import Gaussians


@pytest.fixture(scope="session")
def ball() -> Gaussians:
    """A ball of 5 cm, filled with Gaussians on a jittered grid of 9 mm."""
    rng = np.random.default_rng(0)
    grid = np.arange(-0.054, 0.055, 0.009)
    points = np.stack(np.meshgrid(grid, grid, grid, indexing="ij"), axis=-1).reshape(-1, 3)
    points += rng.uniform(-0.15, 0.15, points.shape) * 0.009
    means = points[np.linalg.norm(points, axis=1) < 0.0465].astype(np.float32)
    ones = np.ones(len(means), np.float32)
    upright = np.tile(np.array([1, 0, 0, 0], np.float32), (len(means), 1))
    return Gaussians(means, 0.0054 * np.ones_like(means), upright, 0.9 * ones, 0 * means, 0.009**3 * ones)
