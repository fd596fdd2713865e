from dataclasses import replace

import numpy as np
import pytest

from model.gap.graph import Graph


@pytest.fixture
def block() -> Graph:
    """9 × 8 × 7 points, held at two, slack by a tenth in the upper half."""
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(np.arange(9), np.arange(8), np.arange(7), indexing="ij"), -1).reshape(-1, 3)
    points = 0.02 * grid.astype(np.float64)
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    springs = np.argwhere(np.triu(apart < 0.036, 1)).astype(np.int64)
    upper = points[springs].mean(1)[:, 2] > 0.07
    controllers = points[[0, 1, -1]] + [0, 0, 0.01]
    return Graph(
        points,
        rng.uniform(0.001, 0.002, len(points)),
        springs,
        apart[tuple(springs.T)] * np.where(upper, 1.1, 1.0),
        np.where(points[springs].mean(1)[:, 0] > 0.08, 300.0, 30.0),
        0.05,
        controllers,
        np.array([[0, 0], [0, 1], [2, len(points) - 1]]),
        np.array([0.01, 0.02, 0.01]),
        np.array([100.0, 200.0, 300.0]),
    )


def test_few_points_stay_as_they_are(block):
    same, became = block.within(len(block.points))
    assert same is block
    np.testing.assert_array_equal(became, np.arange(len(block.points)))


def test_a_coarser_graph_keeps_what_a_uniform_strain_feels(block):
    coarse, became = block.within(80)
    assert 40 < len(coarse.points) <= 80
    assert became.max() == len(coarse.points) - 1
    assert coarse.mass.sum() == pytest.approx(block.mass.sum())
    feels = (block.stiffness * block.lengths**2).sum(), block.damping * (block.lengths**2).sum()
    assert (coarse.stiffness * coarse.lengths**2).sum() == pytest.approx(feels[0])
    assert coarse.damping * (coarse.lengths**2).sum() == pytest.approx(feels[1])
    assert len(np.unique(coarse.springs, axis=0)) == len(coarse.springs)
    assert set(coarse.springs.ravel()) == set(range(len(coarse.points)))


def test_stiff_places_stay_stiff_and_slack_ones_slack(block):
    coarse, _ = block.within(80)
    middle = coarse.points[coarse.springs].mean(1)
    firm = coarse.stiffness * coarse.lengths**2
    assert np.median(firm[middle[:, 0] > 0.12]) > 4 * np.median(firm[middle[:, 0] < 0.04])
    strain = coarse.rest_length / coarse.lengths
    assert strain[middle[:, 2] < 0.03].mean() == pytest.approx(1.0, abs=0.02)
    assert strain[middle[:, 2] > 0.11].mean() == pytest.approx(1.1, abs=0.02)


def test_the_hand_keeps_its_hold(block):
    coarse, became = block.within(80)
    np.testing.assert_array_equal(np.unique(coarse.grip[:, 0]), [0, 2])
    assert coarse.grip_stiffness.sum() == pytest.approx(600.0)
    assert set(coarse.grip[:, 1]) == {became[0], became[1], became[-1]}
    reach = np.linalg.norm(coarse.controllers[coarse.grip[:, 0]] - coarse.points[coarse.grip[:, 1]], axis=1)
    assert np.abs(coarse.grip_length - reach).max() < 0.01


def test_what_is_apart_stays_apart(block):
    """A cut that no spring crosses is none that a coarser graph closes."""
    way = block.points[block.springs]
    crossing = (way[:, 0, 0] < 0.09) != (way[:, 1, 0] < 0.09)
    kept = ~crossing
    cut = replace(
        block,
        springs=block.springs[kept],
        rest_length=block.rest_length[kept],
        stiffness=block.stiffness[kept],
    )
    coarse, became = cut.within(80)
    side = np.array([set(cut.points[became == i, 0] < 0.09) for i in range(len(coarse.points))], dtype=object)
    pure = np.array([len(each) == 1 for each in side])
    ends = coarse.points[coarse.springs][..., 0] < 0.09
    joins = ends[:, 0] != ends[:, 1]
    assert pure[coarse.springs].all(1)[joins].sum() == 0
