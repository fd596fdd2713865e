"""A spring that yields, strained slowly, against the closed form of linear kinematic hardening."""

import numpy as np
import pytest

from model.gap.effects.plasticity import PlasticSpring

STIFFNESS, YIELD = 100.0, 0.02


@pytest.fixture
def tensions(strained):
    """A function: of a spring and its plasticity [N]; what has flowed is felt a look later."""

    def of(strains, hardening, flow_rate=200.0, dt=0.05):
        constants = {"flow_rate": flow_rate, "yield_strain": YIELD, "hardening": hardening}
        return strained(PlasticSpring, strains, STIFFNESS, dt, 2, **constants)

    return of


@pytest.mark.parametrize("hardening", [0.0, 0.25, 0.9])
def test_beyond_the_yield_strain_what_hardens_goes_on(tensions, hardening):
    """Elastic with k, then with h k; back with k again over twice the yield strain, then with h k."""
    there = np.linspace(0.0, 0.1, 401)
    up, down = np.split(tensions([*there, *there[::-1]], hardening), 2)
    loading = STIFFNESS * np.where(there < YIELD, there, YIELD + hardening * (there - YIELD))
    np.testing.assert_allclose(up, loading, atol=1e-3 * STIFFNESS)
    back = 0.1 - there[::-1]
    unloading = loading[-1] - STIFFNESS * np.where(
        back < 2 * YIELD, back, 2 * YIELD + hardening * (back - 2 * YIELD)
    )
    np.testing.assert_allclose(down, unloading, atol=1e-3 * STIFFNESS)


def test_what_is_let_go_comes_back_as_far_as_the_rest_pulls_it(tensions):
    """Without hardening it stays as long as it flowed; with half of it at most the yield strain is left."""

    def left(hardening):
        strains = [*np.linspace(0.0, 0.1, 401), *np.linspace(0.1, -0.05, 601)]
        found = tensions(strains, hardening)[401:]
        return np.interp(0.0, found[::-1], strains[401:][::-1])

    assert left(0.0) == pytest.approx(0.1 - YIELD, abs=1e-3)
    assert 0.0 < left(0.5) < YIELD + 1e-3


def test_slow_flow_creeps(tensions):
    """At a held strain the overstress dies out at the rate of the flow."""
    rate, dt, held = 2.0, 0.01, 0.1
    found = tensions(np.full(100, held), 0.0, rate, dt / 2)
    passed = dt * np.arange(1, 101) - dt / 2  # two half steps each, the last of which is felt later
    over = found / STIFFNESS - YIELD
    np.testing.assert_allclose(over, (held - YIELD) * np.exp(-rate * passed), rtol=1e-6)
