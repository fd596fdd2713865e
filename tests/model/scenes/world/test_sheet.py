import numpy as np
import pytest

from model.scenes.world.sheet import Sheet


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def test_a_sheet_has_its_area_its_strips_and_its_waves(rng):
    waves = np.array([[0.002, 20.0, 0.0, 0.3]])
    sheet = Sheet((0.2, 0.1), 0.0, 0.001, waves, [0.05])
    assert sheet.volume() == pytest.approx(0.4 * 0.2 * 0.001)
    points = sheet.fill(400, rng)
    assert len(points) == pytest.approx(400, rel=0.12)
    assert np.ptp(points[:, 2]) == pytest.approx(0.004, abs=3e-4)
    np.testing.assert_array_equal(sheet.part(points), (points[:, 0] > 0.05).astype(int))
    normals = sheet.normals(points)
    assert (normals[:, 2] > 0.99).all()
    assert np.abs(normals[:, 0]).max() > 0.02
