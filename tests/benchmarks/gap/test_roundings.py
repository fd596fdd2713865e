"""The measure of what a rounding does: a rope that is pressed together, with its hinges and without."""

import numpy as np

from benchmarks.gap.roundings import astray
from model.types import Observation


def test_a_rope_goes_where_it_went_before_only_with_its_hinges():
    """Held at both ends, which come together and go apart: the chain of its twin buckles."""
    rng = np.random.default_rng(4)
    s, times = np.linspace(0, 1, 30), np.arange(45) / 30.0
    together = 0.4 * np.sin(np.pi * times / times[-1]) ** 2
    length = 0.4 * (1.0 - together[:, None])
    sag = np.sqrt(0.4**2 - length**2 + 1e-4) * 0.5
    places = np.stack([length * s, 0 * length * s, -sag * np.sin(np.pi * s)], -1)
    points = places + rng.normal(0, 5e-4, places.shape)
    hands = places[:, [0, -1]]
    seen = Observation(times, points.astype(np.float32), hands.astype(np.float32))
    (without, _), (with_them, _) = (astray(seen, calm) for calm in (False, True))
    assert with_them < 0.1 * without
