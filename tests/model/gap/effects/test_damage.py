"""A spring that was stretched, against what the literature's laws say of it."""

import numpy as np
import pytest

from model.gap.effects.damage import DamagedSpring

STIFFNESS, SOFTENING, SCALE = 100.0, 0.6, 0.05


@pytest.fixture
def tensions(strained):
    """A function: of a spring and its damage [N], strained in turn."""

    def of(strains, pseudo_elasticity):
        constants = {"softening": SOFTENING, "damage_strain": SCALE, "pseudo_elasticity": pseudo_elasticity}
        return strained(DamagedSpring, strains, STIFFNESS, **constants)

    return of


def lost(beyond):
    return SOFTENING * np.tanh(np.asarray(beyond) / SCALE)


LOADING = np.linspace(0.0, 0.2, 41)


def test_where_it_is_lost_for_good_a_spring_softens_as_it_is_stretched_and_unloads_straight(tensions):
    """On the way up by how far it is strained, on the way down by how far it was."""
    up, down = np.split(tensions([*LOADING, *LOADING[::-1]], 0.0), 2)
    np.testing.assert_allclose(up, STIFFNESS * LOADING * (1 - lost(LOADING)), atol=1e-9)
    np.testing.assert_allclose(down, STIFFNESS * LOADING[::-1] * (1 - lost(0.2)), atol=1e-9)


def test_where_it_is_pseudo_elastic_the_first_stretch_is_as_of_a_whole_spring(tensions):
    """And every later one below it, until it is stretched as far: Ogden and Roxburgh."""
    farther = np.linspace(0.2, 0.3, 11)
    path = [*LOADING, *LOADING[::-1], *LOADING, *farther]
    up, down, again = np.split(tensions(path, 1.0)[: 3 * len(LOADING)], 3)
    np.testing.assert_allclose(up, STIFFNESS * LOADING, atol=1e-9)
    np.testing.assert_allclose(down, STIFFNESS * LOADING[::-1] * (1 - lost(0.2 - LOADING[::-1])), atol=1e-9)
    np.testing.assert_allclose(again, down[::-1], atol=1e-9)
    np.testing.assert_allclose(tensions(path, 1.0)[-len(farther) :], STIFFNESS * farther, atol=1e-9)


@pytest.mark.parametrize("pseudo_elasticity", [0.0, 0.5, 1.0])
def test_a_cycle_never_gives_back_more_than_it_took(tensions, pseudo_elasticity):
    for strain in (0.05, 0.2):
        there = np.linspace(0.0, strain, 400)
        up, down = np.split(tensions([*there, *there[::-1]], pseudo_elasticity), 2)
        assert np.trapezoid(up, there) >= -np.trapezoid(down, there[::-1]) - 1e-9
        assert (up >= -1e-9).all()
        assert (down >= -1e-9).all()


def test_of_compression_it_makes_no_difference_when_it_is_lost(tensions):
    path = [0.1, -0.02, -0.05]
    np.testing.assert_allclose(tensions(path, 0.0)[1:], tensions(path, 1.0)[1:])
