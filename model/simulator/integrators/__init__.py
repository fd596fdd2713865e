"""Integrators; listed here, one is in the shared tests of order and energy."""

from model.simulator.integrators.semi_implicit_euler import SemiImplicitEuler

ALL_INTEGRATORS = (SemiImplicitEuler,)
