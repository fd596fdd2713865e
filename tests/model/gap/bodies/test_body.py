"""Bodies from points that are seen: what they are, what joins them, what is held."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull, cKDTree
from scipy.spatial.transform import Rotation

from model.errors import InputError
from model.gap.bodies.body import body_of
from model.gap.bodies.first import first_places
from model.gap.bodies.guess import backed, guess_shape
from model.types import Observation


def seen(places, controllers=None, frames=4):
    hands = np.zeros((0, 3)) if controllers is None else np.asarray(controllers)
    return Observation(
        times=np.arange(frames) / 30.0,
        points=np.repeat(np.asarray(places, np.float32)[None], frames, 0),
        controllers=np.repeat(hands.astype(np.float32)[None], frames, 0),
    )


@pytest.fixture
def rope():
    """180 points on a bent rope of 0.5 m, 1 cm thick."""
    rng = np.random.default_rng(0)
    s, angle = np.linspace(0, 1, 180), rng.uniform(0, 2 * np.pi, 180)
    line = np.stack([0.5 * s, 0.06 * np.sin(np.pi * s), 0 * s], -1)
    return line + 0.005 * np.stack([0 * s, np.cos(angle), np.sin(angle)], -1)


@pytest.fixture
def sheet():
    """A wavy sheet of 0.3 × 0.24 m, standing."""
    u, v = np.meshgrid(np.linspace(0, 0.3, 15), np.linspace(0, 0.24, 12), indexing="ij")
    return np.stack([u, 0.02 * np.sin(20 * u), v], -1).reshape(-1, 3)


@pytest.fixture
def ball():
    """180 points all over a ball of 0.2 m."""
    i = np.arange(180) + 0.5
    z, angle = 1 - i / 90, np.pi * (1 + 5**0.5) * i
    across = np.sqrt(1 - z**2)
    return 0.1 * np.stack([across * np.cos(angle), across * np.sin(angle), z], -1)


@pytest.mark.parametrize("name", ["rope", "sheet", "solid"])
def test_knows_what_it_sees(name, request):
    places = request.getfixturevalue("ball" if name == "solid" else name)
    for turn in Rotation.random(4, random_state=1):
        assert guess_shape(turn.apply(places) + np.array([1.0, 2.0, 3.0])) == name
    assert body_of(seen(places)).shape == name


@pytest.mark.parametrize(("between", "deep"), [(0.08, 0.14), (0.1, 0.08), (0.1, 0.2), (0.12, 0.14)])
def test_a_cloth_that_sags_between_two_hands_is_no_solid(between, deep):
    # two straight halves that face each other, joined by half a tube
    radius, step = 0.5 * between, 0.022
    way = np.arange(0.0, 2.0 * deep + np.pi * radius, step)
    angle = np.clip((way - deep) / radius, 0.0, np.pi)
    beyond = np.maximum(way - deep - np.pi * radius, 0.0)
    height = np.where(way < deep, deep - way, beyond - radius * np.sin(angle))
    across = np.arange(0.0, 0.26, step)
    places = np.stack(np.broadcast_arrays((-radius * np.cos(angle))[:, None], across, height[:, None]), -1)
    places = places.reshape(-1, 3) + np.random.default_rng(0).normal(0.0, 0.001, (len(way) * len(across), 3))
    assert backed(places) > 0.7
    assert guess_shape(places) == "sheet"
    assert body_of(seen(places)).shape == "sheet"


def test_what_has_limbs_is_a_solid_and_a_saddle_is_a_sheet(ball):
    sizes = [np.array([1.0, 0.6, 0.5])] + 4 * [np.array([0.5, 0.35, 0.35])]
    middles = np.array([[0, 0, 0], *[[x, y, 0] for x in (-0.1, 0.1) for y in (-0.08, 0.08)]])
    plush = []
    for size, middle in zip(sizes, middles, strict=True):
        part = ball[:: 1 if size[0] == 1 else 2] * size + middle
        depth = [(((part - at) / (0.0999 * own)) ** 2).sum(1) for own, at in zip(sizes, middles, strict=True)]
        plush.append(part[np.min(depth, axis=0) > 1.0])
    u, v = np.meshgrid(np.linspace(-0.15, 0.15, 14), np.linspace(-0.15, 0.15, 14))
    saddle = np.stack([u, v, 3 * (u**2 - v**2)], -1).reshape(-1, 3)
    assert guess_shape(np.concatenate(plush)) == "solid"
    assert guess_shape(saddle) == "sheet"


@pytest.mark.parametrize("turn", [[0.0, 0.0, 0.0], [0.03, 0.02, 0.0]])
def test_a_plane_in_the_air_that_nobody_holds_is_a_sheet(turn):
    """Something bears it, but nothing says how thick that is."""
    u, v = np.meshgrid(np.linspace(0, 0.3, 12), np.linspace(0, 0.2, 9), indexing="ij")
    places = Rotation.from_rotvec(turn).apply(np.stack([u, v, 0 * u + 0.5], -1).reshape(-1, 3))
    held_up = replace(seen(places, frames=12), ground_height=0.0)
    assert body_of(held_up).shape == "sheet"
    with pytest.raises(InputError, match="a solid are in one plane"):
        body_of(held_up, "solid")


def test_a_slope_that_stands_on_the_ground_is_a_side_of_a_solid():
    """A plane as well, but between it and its underside there is a volume."""
    u, v = np.meshgrid(np.linspace(0, 0.3, 12), np.linspace(0, 0.2, 9), indexing="ij")
    places = np.stack([u, v, 0.01 + 0.4 * u], -1).reshape(-1, 3)
    assert body_of(replace(seen(places, frames=12), ground_height=0.0)).shape == "solid"


def test_long_limbs_do_not_make_a_sheet(ball):
    """Its hull is mostly air, and has more surface than it, as a sheet's has; behind each side is another."""
    sizes = [np.array([0.6, 0.5, 0.4])] + 4 * [np.array([1.3, 0.3, 0.25])]
    middles = [np.zeros(3), *(np.array([0.18 * x, 0.14 * y, 0.0]) for x in (-1, 1) for y in (-1, 1))]
    turns = [0.0, *(x * y * 0.66 for x in (-1, 1) for y in (-1, 1))]
    parts = [
        Rotation.from_rotvec([0.0, 0.0, turn]).apply(ball[:: 2 if turn else 3] * size) + middle
        for size, middle, turn in zip(sizes, middles, turns, strict=True)
    ]
    plush = np.concatenate(parts)
    reach = cKDTree(plush).query(plush, k=4)[0][:, -1]
    assert (np.pi * reach**2 / 4).sum() < 0.58 * ConvexHull(plush).area
    assert guess_shape(plush) == "solid"
    assert backed(plush) > 0.5


@pytest.mark.parametrize("height", [lambda r: -r, lambda r: -4 * r**2, lambda r: 0.02 * np.sin(40 * r)])
def test_behind_a_draped_cloth_is_nothing(height):
    u, v = np.meshgrid(np.linspace(-0.15, 0.15, 14), np.linspace(-0.15, 0.15, 14))
    cloth = np.stack([u, v, height(np.hypot(u, v))], -1).reshape(-1, 3)
    assert backed(cloth) < 0.05
    assert guess_shape(cloth) == "sheet"


def test_markers_in_a_row_are_a_rope():
    row = np.stack([np.linspace(0, 1, 9), np.zeros(9), np.zeros(9)], -1)
    body = body_of(seen(row, controllers=[[-0.1, 0, 0], [1.1, 0, 0]]))
    assert body.shape == "rope"
    assert body.points[:, 0].min() == pytest.approx(-0.1)
    assert body.points[:, 0].max() == pytest.approx(1.1)
    assert len(body.springs) == len(body.points) - 1
    assert set(body.grip[:, 0]) == {0, 1}


def grid(rows, columns, noise=0.0, seed=0):
    """Markers on a cloth, 10 cm apart."""
    u, v = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    flat = 0.1 * np.stack([u, v, 0 * u], -1).reshape(-1, 3)
    return flat + np.random.default_rng(seed).normal(0, noise, flat.shape)


@pytest.mark.parametrize(("rows", "columns"), [(4, 4), (3, 3), (3, 4), (2, 4), (2, 8), (3, 6)])
def test_markers_in_rows_are_a_sheet(rows, columns):
    turn = Rotation.from_rotvec([0.4, -0.7, 1.0])
    for noise in (0.0, 0.001, 0.003):
        for seed in range(5):
            places = turn.apply(grid(rows, columns, noise, seed))
            assert guess_shape(places) == "sheet"
    wave = places + np.outer(0.03 * np.sin(9 * grid(rows, columns)[:, 0]), turn.apply([0.0, 0.0, 1.0]))
    assert guess_shape(wave) == "sheet"
    body = body_of(seen(wave, controllers=wave[:1]))
    assert body.shape == "sheet"
    assert len(body.points) == rows * columns
    assert len(body.grip)


def test_markers_all_around_are_a_solid():
    corners = np.stack(np.meshgrid(*3 * [[0.0, 0.1]], indexing="ij"), -1).reshape(-1, 3)
    for seed in range(5):
        places = corners + np.random.default_rng(seed).normal(0, 0.002, corners.shape)
        assert guess_shape(places) == "solid"
        assert len(np.unique(body_of(seen(places)).springs)) == len(body_of(seen(places)).points)


def hook(count):
    """Markers on a rope that is bent back on itself, its legs 12 cm apart, twice as far as markers."""
    way = np.linspace(0.0, 0.06 * (count - 1), count)
    leg = 0.5 * (way[-1] - 0.06 * np.pi)
    turn = np.clip((way - leg) / 0.06, 0.0, np.pi)
    x = np.minimum(way, leg) + 0.06 * np.sin(turn) - np.maximum(way - leg - 0.06 * np.pi, 0.0)
    return np.stack([x, 0.06 * (1 - np.cos(turn)), 0 * x], -1)


@pytest.mark.parametrize("count", [3, 5, 8, 9, 14, 19])
def test_markers_on_a_bent_rope_are_a_rope_in_their_order(count):
    places = hook(count)
    order = np.random.default_rng(count).permutation(count)
    assert guess_shape(places[order]) == "rope"
    body = body_of(seen(places[order]))
    assert body.shape == "rope"
    steps = np.linalg.norm(np.diff(body.points, axis=0), axis=1)
    longest = np.linalg.norm(np.diff(places, axis=0), axis=1).sum()
    assert steps.sum() == pytest.approx(longest, rel=1e-6)


@pytest.mark.parametrize("count", range(18, 28))
def test_as_many_markers_as_slices_hold_two_of_are_a_rope(count):
    """Noise makes no slice hold three of them."""
    noise = np.random.default_rng(count).normal(0, 1e-4, (count, 3))
    assert guess_shape(np.linspace([0, 0, 1], [0.5, 0.05, 1], count) + noise) == "rope"


def test_markers_side_by_side_on_a_rope_are_no_short_stiff_spring():
    """Random markers: two of 20 may be 2 mm apart, as far as noise makes them."""
    rng = np.random.default_rng(5)
    along = np.sort(np.concatenate([np.linspace(0.0, 0.8, 18), [0.002, 0.41, 0.412]]))
    places = np.stack([along, 0 * along, 0 * along], -1) + rng.normal(0, 5e-4, (len(along), 3))
    body = body_of(seen(places))
    assert body.shape == "rope"
    length = np.linalg.norm(np.diff(body.points, axis=0), axis=1)
    assert length.min() > 0.45 * np.median(length)
    told = (body.points[body.index] * body.weight[..., None]).sum(1)
    np.testing.assert_allclose(told, places, atol=1.5e-3)
    assert np.linalg.norm(np.diff(body.points[[0, -1]], axis=0)) == pytest.approx(0.8, abs=5e-3)


def test_a_rope_of_many_points_is_as_long_as_they_say():
    """Its middle line is of means of slices, whose ends are not the rope's."""
    places = np.random.default_rng(1).normal(size=(400, 3)) * 0.002
    places[:, 0] = np.linspace(0.0, 0.7, 400)
    body = body_of(seen(places))
    assert body.shape == "rope"
    assert np.ptp(body.points[:, 0]) == pytest.approx(0.7, abs=4e-3)
    assert len(body.points) > 40
    assert body.grasp == pytest.approx(2.0 * body.spacing)


@pytest.mark.parametrize("name", ["rope", "sheet", "ball"])
def test_what_is_seen_lies_on_the_body(name, request):
    places = request.getfixturevalue(name)
    body = body_of(seen(places))
    np.testing.assert_allclose(body.weight.sum(1), 1.0)
    bound = (body.weight[..., None] * body.points[body.index]).sum(1)
    assert np.linalg.norm(bound - places, axis=1).max() < body.spacing
    assert body.share.sum() == pytest.approx(1.0)
    assert len(np.unique(body.springs)) == len(body.points)


def test_a_solid_has_an_inside(ball):
    body = body_of(seen(ball))
    assert (np.linalg.norm(body.points, axis=1) < 0.08).sum() > 20
    assert (np.linalg.norm(body.points, axis=1) < 0.1001).all()


def test_another_scale_is_another_lattice(sheet):
    assert len(body_of(seen(sheet), scale=1.4).points) < 0.8 * len(body_of(seen(sheet)).points)


def test_controllers_hold_what_is_within_reach(sheet):
    body = body_of(seen(sheet, controllers=[sheet[0], [0.0, 0.0, 1.0]]))
    assert set(body.grip[:, 0]) == {0}
    held = body.points[body.grip[:, 1]]
    assert np.linalg.norm(held - sheet[0], axis=1).max() < body.spacing


def test_a_hidden_point_is_placed_by_its_neighbours(sheet):
    observation = seen(sheet)
    points = observation.points.copy()
    points[1:] += np.array([0.0, 0.0, 0.05], np.float32)
    points[0, 7] = np.nan
    moved = Observation(observation.times, points, observation.controllers)
    np.testing.assert_allclose(first_places(moved)[7], sheet[7], atol=1e-6)


def test_refuses_what_is_never_seen():
    with pytest.raises(InputError, match="fewer than three"):
        body_of(seen(np.full((5, 3), np.nan)))
