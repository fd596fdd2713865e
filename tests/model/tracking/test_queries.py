import numpy as np
import pytest
from scipy.spatial import cKDTree

from model.tracking import sample_queries


def ring():
    y, x = np.mgrid[:200, :300]
    radius = np.hypot(x - 150, y - 100)
    return (radius < 90) & (radius > 40)


def test_queries_lie_in_the_mask_evenly():
    mask = ring()
    queries = sample_queries(mask, 200, seed=3)
    assert len(queries) == 200
    columns, rows = queries.astype(int).T
    assert mask[rows, columns].all()
    gaps = cKDTree(queries).query(queries, 2)[0][:, 1]
    ideal = np.sqrt(mask.sum() / 200)
    assert gaps.min() > 0.4 * ideal
    holes = cKDTree(queries).query(np.argwhere(mask)[:, ::-1])[0]
    assert holes.max() < 1.6 * ideal


def test_seed_decides_and_repeats():
    first, second, other = (sample_queries(ring(), 50, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(first, second)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("pixels", [0, 1, 7])
def test_a_small_mask_gives_what_it_has(pixels):
    mask = np.zeros((20, 20), bool)
    mask[4, 3 : 3 + pixels] = True
    assert len(sample_queries(mask, 10)) == pixels
