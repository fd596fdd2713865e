"""Rows and cells of shapes in which they can be counted."""

import numpy as np
import pytest

from model.simulator.structure import between_neighbours, cells, faces, rows, rows_of_line, spans, turns


def test_a_chain_is_one_row():
    points = np.stack([0.1 * np.arange(5), np.zeros(5), np.zeros(5)], -1)
    springs = np.stack([np.arange(4), np.arange(1, 5)], -1)
    triples = rows(points, springs)
    assert triples.tolist() == [[0, 1, 2], [1, 2, 3], [2, 3, 4]]
    np.testing.assert_allclose(spans(points, triples), 0.2)
    np.testing.assert_allclose(turns(points, triples), 0.0, atol=1e-12)


def test_a_corner_is_no_row():
    points = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0]])
    assert len(rows(points, np.array([[0, 1], [1, 2]]))) == 0


def test_a_bend_turns():
    angle = np.deg2rad(20.0)
    points = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1 + 0.1 * np.cos(angle), 0.1 * np.sin(angle), 0]])
    triples = rows(points, np.array([[0, 1], [1, 2]]))
    np.testing.assert_allclose(turns(points, triples), 2 * np.tan(angle / 2))


def test_springs_that_reach_over_a_neighbour_are_not_between_neighbours():
    points = np.stack([0.1 * np.arange(6), np.zeros(6), np.zeros(6)], -1)
    chain, over = ([[i, i + by] for i in range(6 - by)] for by in (1, 2))
    both = np.array([*chain, *over])
    assert between_neighbours(points, both).tolist() == chain
    assert rows(points, both).tolist() == rows(points, np.array(chain)).tolist()


def test_points_without_springs_have_no_neighbours():
    assert between_neighbours(np.zeros((3, 3)), np.zeros((0, 2), np.int64)).shape == (0, 2)


def test_a_point_that_nothing_holds_does_not_matter():
    points = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.2, 0, 0], [9.0, 0, 0]])
    assert between_neighbours(points, np.array([[0, 1], [1, 2], [0, 2]])).tolist() == [[0, 1], [1, 2]]


def test_rows_of_a_line_are_a_ropes_alone():
    chain = np.stack([0.1 * np.arange(5), np.zeros(5), np.zeros(5)], -1)
    links = np.stack([np.arange(4), np.arange(1, 5)], -1)
    assert rows_of_line(chain, links).tolist() == rows(chain, links).tolist()
    net = np.stack(np.meshgrid(np.arange(4), np.arange(4), [0.0], indexing="ij"), -1).reshape(-1, 3)
    meshes = np.array(
        [[i, i + by] for i in range(16) for by in (1, 4) if i % 4 + (by == 1) < 4 and i + by < 16]
    )
    assert len(rows(net, meshes)) > 0
    assert len(rows_of_line(net, meshes)) == 0
    assert len(rows_of_line(chain, np.zeros((0, 2), np.int64))) == 0


def test_cells_fill_a_block():
    """A grid of cubes, shaken a little so that no five points lie on a sphere."""
    grid = np.stack(np.meshgrid(*3 * [np.arange(4)], indexing="ij"), -1).reshape(-1, 3) * 0.1
    points = grid + np.random.default_rng(0).normal(0, 1e-3, grid.shape)
    corners, volumes = cells(points, 0.1)
    assert volumes.sum() == pytest.approx(0.3**3, rel=0.05)
    sides = points[corners[:, 1:]] - points[corners[:, :1]]
    np.testing.assert_allclose(np.linalg.det(sides) / 6.0, volumes)


def test_what_is_flat_has_no_cells():
    flat = np.stack(np.meshgrid(np.arange(4), np.arange(4)), -1).reshape(-1, 2) * 0.1
    corners, volumes = cells(np.concatenate([flat, np.zeros((16, 1))], 1), 0.1)
    assert len(corners) == len(volumes) == 0


def test_faces_of_a_net_are_its_triangles():
    """Two for each of 3 × 2 meshes of a net of rows; springs that reach over a neighbour make none."""
    column, row = np.meshgrid(np.arange(4), np.arange(3), indexing="ij")
    points = np.stack([column + 0.5 * (row % 2), np.sqrt(0.75) * row, 0.0 * row], -1).reshape(-1, 3)
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    near, far = (np.argwhere(np.triu((apart > 0) & (apart < reach), 1)) for reach in (1.2, 2.2))
    triangles = faces(points, near)
    assert len(triangles) == 12
    assert len(np.unique(np.sort(triangles, 1), axis=0)) == 12
    sides = points[triangles[:, 1:]] - points[triangles[:, :1]]
    np.testing.assert_allclose(np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1), np.sqrt(0.75))
    assert faces(points, far).tolist() == triangles.tolist()


def test_a_chain_has_no_faces():
    points = np.stack([0.1 * np.arange(5), np.zeros(5), np.zeros(5)], -1)
    assert faces(points, np.stack([np.arange(4), np.arange(1, 5)], -1)).shape == (0, 3)
