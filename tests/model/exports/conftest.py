"""Small twins of three shapes, as the benchmark of parity has them."""

import importlib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from model.bundle import TwinBundle


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], ModuleType]:
    """A module of benchmarks/exports."""
    monkeypatch.syspath_prepend(Path(__file__).parents[3] / "benchmarks/exports")
    return importlib.import_module


@pytest.fixture
def sheet(bench: Callable[[str], ModuleType]) -> TwinBundle:
    return bench("procedural").sheet(size=5)


@pytest.fixture
def rope(bench: Callable[[str], ModuleType]) -> TwinBundle:
    return bench("procedural").rope(size=8)


@pytest.fixture
def falling(bench: Callable[[str], ModuleType]) -> TwinBundle:
    """A block above the ground, that nobody holds."""
    return bench("procedural").solid(ground=True, size=3)
