import numpy as np

from model.controllers.geodesics import ways_through
from model.types import Gaussians


def gaussians_at(means):
    count = len(means)
    return Gaussians(
        np.asarray(means, np.float32),
        np.full((count, 3), 0.01, np.float32),
        np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
        np.full(count, 0.9, np.float32),
        np.full((count, 3), 0.5, np.float32),
        np.full(count, 1e-6, np.float32),
    )


def test_ways_follow_the_body_around_a_bend():
    angle = np.linspace(0, np.pi, 400)
    spread = np.random.default_rng(0).uniform(-0.005, 0.005, (400, 3))
    arc = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1) * 0.2 + spread
    way = ways_through(gaussians_at(arc), arc[:1], arc[[0, 200, -1]])[0]
    np.testing.assert_allclose(way, [0.0, 0.1 * np.pi, 0.2 * np.pi], rtol=0.05, atol=1e-3)


def test_between_loose_pieces_the_straight_distance_counts():
    cloud = np.random.default_rng(0).uniform(0, 0.1, (200, 3))
    both = np.concatenate([cloud, cloud + np.array([1.0, 0, 0])])
    way = ways_through(gaussians_at(both), both[:1], both[200:201])
    np.testing.assert_allclose(way, 1.0, rtol=1e-3)
