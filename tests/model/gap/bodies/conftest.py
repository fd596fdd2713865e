"""Recordings of bars that are held at one end and let go."""

from collections.abc import Callable

import numpy as np
import pytest

from model.types import Observation

GRAVITY = 9.81
LENGTH, SIDE = 0.1, 0.03
"""Of the bar [m], along x from the clamp at -LENGTH to the tip at 0."""
MODE = 1.8751
"""First root of cos β cosh β = -1: of the first mode of a cantilever."""


def _mode(share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Deflection of the first mode, 1 at the tip, and its slope per length; 0 at the clamp."""
    ratio = (np.cosh(MODE) + np.cos(MODE)) / (np.sinh(MODE) + np.sin(MODE))
    b = MODE * share
    bent = np.cosh(b) - np.cos(b) - ratio * (np.sinh(b) - np.sin(b))
    slope = MODE * (np.sinh(b) + np.sin(b) - ratio * (np.cosh(b) - np.cos(b)))
    return bent / 2.0, slope / 2.0


@pytest.fixture
def cantilever() -> Callable[..., Observation]:
    """A uniform elastic bar that sags as its first mode says, after it was held straight for a while.

    Euler and Bernoulli: a bar of weight w per length sags by w L⁴ / 8 E I at its tip and swings in its first
    mode with ω² = 1.8751⁴ E I / (μ L⁴), so that drop times ω² is 1.5453 g, whatever it is made of.
    """

    def made(
        period: float = 0.13, damping: float = 0.05, held: float = 0.0, seconds: float = 1.2
    ) -> Observation:
        times = np.arange(round((held + seconds) * 100)) / 100.0
        omega = 2.0 * np.pi / period
        drop = MODE**4 / 8.0 * GRAVITY / omega**2
        since = np.maximum(times - held, 0.0)
        swung = np.cos(omega * np.sqrt(1 - damping**2) * since) + damping * np.sin(omega * since)
        down = drop * (1.0 - np.exp(-damping * omega * since) * swung)
        markers = np.array([[0.0, 0.0, 0.03], [0.0, -0.005, 0.012], [0.0, 0.032, 0.008]])
        bent, slope = _mode(1.0 + markers[:, 0] / LENGTH)
        points = np.repeat(markers[None], len(times), 0)
        points[..., 2] -= down[:, None] * bent
        points[..., 0] += down[:, None] * slope / LENGTH * (markers[:, 2] - SIDE / 2)
        hand = np.array([[-LENGTH, -0.002, 0.003], [-LENGTH, 0.03, 0.03], [-LENGTH, 0.032, 0.001]])
        controllers = np.repeat(hand[None], len(times), 0)
        return Observation(times, points.astype(np.float32), controllers.astype(np.float32))

    return made
