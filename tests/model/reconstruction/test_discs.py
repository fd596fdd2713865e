import numpy as np
import pytest

from model.reconstruction.discs import inscribed, local_thickness
from model.reconstruction.outline import overlap


def disc(radius):
    y, x = np.mgrid[:200, :200]
    return np.hypot(x - 100, y - 100) <= radius


def test_discs_cover_the_mask_and_nothing_else():
    mask = disc(40) | (np.abs(np.arange(200)[:, None] - 100) < 8) & (np.arange(200)[None] > 20)
    discs = inscribed(mask, np.array([0.0, 1.0]), 1.0)
    y, x = np.mgrid[:200, :200]
    covered = np.zeros_like(mask)
    for (cx, cy), radius in zip(discs.centers, discs.radii, strict=True):
        covered |= np.hypot(x - cx, y - cy) <= radius
    assert overlap(covered, mask) > 0.97
    assert not np.any(covered & ~mask)
    assert len(discs.radii) < 0.2 * np.count_nonzero(mask)


def test_a_squeezed_disc_is_one_disc_again():
    y, x = np.mgrid[:200, :200]
    ellipse = ((x - 100) / 50) ** 2 + ((y - 100) / 30) ** 2 <= 1
    discs = inscribed(ellipse, np.array([0.0, 1.0]), 0.6)
    np.testing.assert_allclose(discs.centers[0], [100, 100], atol=1.5)
    assert discs.radii[0] == pytest.approx(50, abs=1.5)


def test_local_thickness_tells_limb_from_body():
    mask = disc(40) | (np.abs(np.arange(200)[:, None] - 100) < 8) & (np.arange(200)[None] > 20)
    thickness = local_thickness(mask)
    assert thickness[100, 100] == pytest.approx(40, rel=0.1)
    assert thickness[100, 185] == pytest.approx(7.5, rel=0.15)


def test_small_discs_in_the_rim_of_a_large_one_are_nested_and_limbs_are_not():
    mask = disc(40) | (np.abs(np.arange(200)[:, None] - 100) < 8) & (np.arange(200)[None] > 20)
    discs = inscribed(mask, np.array([0.0, 1.0]), 1.0)
    from_middle = np.hypot(*(discs.centers - 100).T)
    assert np.all(discs.radii[discs.owners][from_middle > 65] < 10)
    rim = (from_middle < 40) & (discs.radii < 4)
    assert np.all(discs.nested[rim & (from_middle + discs.radii < 42)] > 0.9)
    assert np.all(discs.radii[discs.owners] >= discs.radii)
