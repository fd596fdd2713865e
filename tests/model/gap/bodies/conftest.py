"""Surfaces of solids, noise of hands, and recordings of beams that are clamped at one end and let go."""

from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.gap.cantilever import Cantilever
from model.types import Observation


@pytest.fixture
def cantilever() -> Callable[..., Observation]:
    """A beam of 10 cm, three markers at its tip, three at its clamp, held straight for a while."""

    def made(held: float = 0.0) -> Observation:
        return Cantilever().recording(1.2, held)

    return made


@pytest.fixture
def noisy():
    """Adds an error of measurement of such a size [m], of which a share is kept from frame to frame."""

    def measured(places, size, memory, seed):
        noise = np.random.default_rng(seed).normal(size=places.shape)
        for t in range(1, len(noise)):
            noise[t] = memory * noise[t - 1] + np.sqrt(1.0 - memory**2) * noise[t]
        return places + size * noise

    return measured


@pytest.fixture
def ring():
    """220 points all over a ring of 0.2 m across its middle line, 0.06 m thick."""
    i = np.arange(220) + 0.5
    # evenly over the surface: more of it is outside of the middle line than inside
    around = np.interp(i / 220, *_share_of_ring(0.3))
    along = np.pi * (1 + 5**0.5) * i
    across = 0.1 + 0.03 * np.cos(around)
    return np.stack([across * np.cos(along), across * np.sin(along), 0.03 * np.sin(around)], -1)


def _share_of_ring(slimness):
    """Share of a ring's surface before each angle around its middle line, and the angle."""
    angle = np.linspace(0.0, 2 * np.pi, 500)
    return (angle + slimness * np.sin(angle)) / (2 * np.pi), angle
