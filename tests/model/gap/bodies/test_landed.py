"""What a camera does not see of a solid that falls is told by how it lies in the end."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from model.gap.bodies.body import body_of
from model.gap.bodies.landed import carried, landed
from model.gap.bodies.rest import rest_places
from model.types import Observation

SIZE = np.array([0.24, 0.16, 0.05])
"""Of a slab [m]."""
TILTED = Rotation.from_euler("xyz", [0.4, -0.3, 0.8])
BEGINS, ENDS, FALLS = np.array([0.2, 0.1, 0.3]), np.array([0.25, 0.12, 0.5 * SIZE[2]]), 7


def slab(rng, hidden=True):
    """Points on its top and its four sides; all around, if nothing is hidden."""
    at = rng.uniform(-0.5, 0.5, (400, 3))
    side = rng.choice(5 if hidden else 6, 400, p=None if not hidden else [0.5, 0.15, 0.15, 0.1, 0.1])
    for face, (axis, sign) in enumerate(((2, 1), (0, 1), (0, -1), (1, 1), (1, -1), (2, -1))):
        at[side == face, axis] = 0.5 * sign
    return at[:160] * SIZE


def recording(places, lies=True, ground=0.0, noise=5e-4):
    """It falls, tilted, and lies flat from some frame on."""
    rng = np.random.default_rng(1)
    times = np.arange(40) / 30.0
    fallen = 4.905 * times[:FALLS, None, None] ** 2 * [0.0, 0.0, 1.0]
    falling = TILTED.apply(places) + BEGINS - fallen
    lying = np.repeat((places + ENDS)[None], 40 - FALLS, axis=0)
    if not lies:
        lying = lying + 0.05 * np.arange(40 - FALLS)[:, None, None]
    points = np.concatenate([falling, lying]) + noise * rng.normal(size=(40, len(places), 3))
    points[rng.random(points.shape[:2]) < 0.1] = np.nan
    return Observation(
        times, points.astype(np.float32), np.zeros((40, 0, 3), np.float32), ground_height=ground
    )


@pytest.fixture
def falling():
    return recording(slab(np.random.default_rng(0)))


def test_its_underside_is_where_it_is_in_the_first_frame(falling):
    found = landed(falling, rest_places(falling))
    own = TILTED.inv().apply(found - BEGINS)
    assert len(found) > 20
    np.testing.assert_allclose(own[:, 2], -0.5 * SIZE[2], atol=3e-3)
    assert (np.ptp(own[:, :2], axis=0) > 0.5 * SIZE[:2]).all()
    assert (np.abs(own[:, :2]) < 0.55 * SIZE[:2]).all()


def test_the_body_reaches_down_to_it(falling):
    def thick(observation):
        return TILTED.inv().apply(body_of(observation, "solid").points - BEGINS)

    below = thick(falling)[:, 2] < -0.4 * SIZE[2]
    inner = (np.abs(thick(falling)[:, :2]) < 0.3 * SIZE[:2]).all(1)
    assert (below & inner).sum() >= 3
    unknown = thick(replace(falling, ground_height=None))
    assert not ((unknown[:, 2] < -0.4 * SIZE[2]) & (np.abs(unknown[:, :2]) < 0.3 * SIZE[:2]).all(1)).any()


@pytest.mark.parametrize("why", ["seen all around", "no ground", "never lies", "does not fall"])
def test_nothing_is_added_where_nothing_is_known_to_be_missing(why):
    places = slab(np.random.default_rng(0), hidden=why != "seen all around")
    ground = None if why == "no ground" else 0.0
    seen = recording(places, lies=why != "never lies", ground=ground)
    if why == "does not fall":
        seen = replace(
            seen, points=seen.points[FALLS:], times=seen.times[FALLS:], controllers=seen.controllers[FALLS:]
        )
    assert not len(landed(seen, rest_places(seen)))


def test_places_go_with_the_points_around_them():
    here = np.random.default_rng(0).uniform(size=(60, 3))
    there = TILTED.apply(here) + BEGINS
    asked = np.array([[0.5, 0.5, -0.2], [0.1, 0.9, 0.4]])
    np.testing.assert_allclose(carried(asked, here, there), TILTED.apply(asked) + BEGINS, atol=1e-9)
    assert carried(asked[:0], here, there).shape == (0, 3)
