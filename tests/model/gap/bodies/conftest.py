"""Recordings of beams that are clamped at one end and let go."""

from collections.abc import Callable

import pytest

from benchmarks.gap.cantilever import Cantilever
from model.types import Observation


@pytest.fixture
def cantilever() -> Callable[..., Observation]:
    """A beam of 10 cm, three markers at its tip, three at its clamp, held straight for a while."""

    def made(held: float = 0.0) -> Observation:
        return Cantilever().recording(1.2, held)

    return made
