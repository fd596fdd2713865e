import numpy as np
import pytest

from model.scenes.world.body import Block, Capsule, Cut, Solid, shares, spread


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def test_the_volume_of_a_ball_and_of_a_box():
    ball = Solid([Capsule((0.0, 0.0, 0.1), (0.0, 0.0, 0.1), 0.05, 0.05)], [0])
    assert ball.volume() == pytest.approx(4 / 3 * np.pi * 0.05**3, rel=0.02)
    box = Solid([Block((0.0, 0.0, 0.0), (0.05, 0.03, 0.02), 0.0)], [0])
    assert box.volume() == pytest.approx(0.1 * 0.06 * 0.04, rel=0.02)


def test_a_filling_has_as_many_points_as_asked_and_reaches_the_surface(rng):
    body = Solid([Block((0.0, 0.0, 0.02), (0.05, 0.03, 0.02), 0.004)], [0])
    points = body.fill(500, rng)
    assert len(points) == pytest.approx(500, rel=0.1)
    assert body.inside(points, 1e-6).all()
    assert points[:, 2].min() < 0.002
    assert points[:, 2].max() > 0.038


def test_shares_are_even_and_sum_to_the_volume(rng):
    body = Solid([Block((0.0, 0.0, 0.0), (0.05, 0.03, 0.02), 0.0)], [0])
    points = body.fill(300, rng)
    volume = shares(body, points)
    assert volume.sum() == pytest.approx(body.volume())
    inner = body.distance(points) < -0.008
    assert np.median(volume[~inner]) < np.median(volume[inner])


def test_surface_points_lie_on_the_surface_and_normals_point_out(rng):
    body = Solid([Capsule((-0.05, 0.0, 0.0), (0.05, 0.0, 0.0), 0.02, 0.03)], [0])
    places = body.surface(200, rng)
    assert len(places) == 200
    np.testing.assert_allclose(body.distance(places), 0.0, atol=3e-4)
    outward = body.normals(places)
    np.testing.assert_allclose(np.linalg.norm(outward, axis=1), 1.0, atol=1e-6)
    assert (body.distance(places + 0.005 * outward) > 0.003).all()


def test_parts_by_piece_and_by_cut():
    pieces = [
        Block((0.0, 0.0, 0.0), (0.1, 0.05, 0.05), 0.0),
        Capsule((0.1, 0.0, 0.0), (0.2, 0.0, 0.0), 0.02, 0.02),
    ]
    body = Solid(pieces, [0, 2], Cut(0, (0.0,), (0, 1)))
    places = np.array([[-0.05, 0.0, 0.0], [0.05, 0.0, 0.0], [0.18, 0.0, 0.0]])
    np.testing.assert_array_equal(body.part(places), [0, 1, 2])
    assert body.parts == 3


def test_spread_points_are_far_from_each_other(rng):
    points = rng.uniform(size=(500, 3))
    chosen = points[spread(points, 30, rng)]
    gaps = np.linalg.norm(chosen[:, None] - chosen, axis=2)[~np.eye(30, dtype=bool)]
    assert gaps.min() > 0.2
