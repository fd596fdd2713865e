import numpy as np
import torch

from model.scenes.anchors import anchor
from model.scenes.replay import observed


def test_any_affine_motion_is_followed_exactly(make_case):
    case = make_case()
    rng = np.random.default_rng(0)
    spread, shift = np.eye(3) + 0.3 * rng.normal(size=(3, 3)), rng.normal(size=3)
    anchors = anchor(case.rest, case.topology.points, case.topology.springs)
    moved = torch.as_tensor(case.topology.points.astype(np.float64) @ spread.T + shift)[None]
    expected = case.rest.astype(np.float64) @ spread.T + shift
    np.testing.assert_allclose(observed(anchors, moved)[0], expected, atol=2e-5)
    np.testing.assert_allclose(anchors.weight.sum(axis=1), 1.0, atol=1e-5)


def test_points_of_a_plane_follow_turns_out_of_it():
    grid = np.stack(np.meshgrid(np.arange(6), np.arange(6), [0]), -1).reshape(-1, 3) * 0.02
    springs = np.array(
        [(i, j) for i in range(36) for j in range(i) if np.linalg.norm(grid[i] - grid[j]) < 0.03]
    )
    seen = np.random.default_rng(1).uniform(0.0, 0.1, (20, 3)) * (1.0, 1.0, 0.0)
    anchors = anchor(seen, grid, springs)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]])
    moved = observed(anchors, torch.as_tensor(grid @ turn.T)[None])[0]
    np.testing.assert_allclose(moved, seen @ turn.T, atol=1e-5)
