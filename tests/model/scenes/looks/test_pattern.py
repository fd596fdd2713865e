import numpy as np
import pytest

from model.scenes.looks.pattern import blend, cells, directions, noise, stripes


@pytest.fixture
def places():
    return np.random.default_rng(0).uniform(-0.3, 0.3, (4000, 3))


def test_noise_is_smooth_centred_and_its_own_for_each_seed(places):
    value = noise(places, 0.02, 1)
    assert np.abs(value).max() <= 1
    assert abs(value.mean()) < 0.05
    assert 0.2 < value.std() < 0.6
    near = noise(places + 0.0002, 0.02, 1)
    assert np.abs(near - value).max() < 0.1
    np.testing.assert_array_equal(noise(places, 0.02, 1), value)
    assert abs(np.corrcoef(noise(places, 0.02, 2), value)[0, 1]) < 0.1


def test_cells_have_borders_and_owners(places):
    border, owner = cells(places, 0.05, 3)
    assert border.min() >= 0
    assert border.min() < 0.01
    deep = border > 0.2
    _, beside = cells(places[deep] + 0.002, 0.05, 3)
    np.testing.assert_array_equal(owner[deep], beside)
    tilt = directions(owner, 3)
    assert np.abs(tilt).max() <= 1
    same = (owner == owner[0]).all(axis=1)
    assert same.sum() > 1
    assert (tilt[same] == tilt[0]).all()


def test_stripes_cover_their_share():
    along = np.linspace(0, 1, 10_000, endpoint=False)
    for width in (0.3, 0.5, 0.7):
        value = stripes(along, 0.02, width)
        assert value.mean() == pytest.approx(width, abs=0.05)
        np.testing.assert_allclose(value, stripes(along + 0.02, 0.02, width), atol=1e-9)


def test_blending_goes_from_one_colour_to_the_other():
    mixed = blend(np.zeros(3), np.ones(3), np.array([0.0, 0.25, 1.0]))
    np.testing.assert_allclose(mixed, np.repeat([[0.0], [0.25], [1.0]], 3, axis=1))
