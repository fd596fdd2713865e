"""A rope that is pulled aside by a known tilt of gravity."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from model.gap.bodies.body import body_of
from model.gap.effects import GravityTilt
from model.gap.hypothesis import Hypothesis
from model.gap.plain import PlainTwin
from model.types import Observation

FRAMES = 40
TILT = {"gravity_tilt.about_x": 0.3, "gravity_tilt.about_y": -0.2}


@pytest.fixture
def tilted():
    """A function: of how fast the hand goes to and fro [rad/s] along x and y, an observation."""
    return _tilted


def _tilted(ways):
    """A hanging rope whose hand goes a way, while it is pulled aside as well."""
    times = np.arange(FRAMES) / 30.0
    places = np.linspace([0.0, 0.0, 0.6], [0.0, 0.0, 0.3], 10)
    way = np.stack([0.06 * np.sin(ways[0] * times), 0.05 * np.sin(ways[1] * times), 0.0 * times], -1)
    still = Observation(
        times=times,
        points=np.repeat(places[None].astype(np.float32), FRAMES, 0),
        controllers=(places[:1] + way[:, None]).astype(np.float32),
    )
    hypothesis = Hypothesis(PlainTwin.of(body_of(still, "rope"), still), (GravityTilt(),))
    values = {name: quantity.start for name, quantity in hypothesis.quantities.items()} | TILT
    with torch.no_grad():
        world = hypothesis.at(values)
        points = world.sight(world.rollout().points).numpy()
    noise = np.random.default_rng(1).normal(0, 5e-4, points.shape)
    return replace(still, points=(points + noise).astype(np.float32))
