"""The side that faces a camera."""

import numpy as np

from benchmarks.reality.generate import make
from benchmarks.reality.hands import rotation
from benchmarks.reality.recipe import Wanted, draw_recipe
from benchmarks.reality.side import cameras, facing_of_line, facing_of_volume, kept
from benchmarks.reality.world import Motion, Scene

SHIFT = np.array([0.3, -0.2, 0.1])


def scene(turn=(0.0, 0.0, 0.0)):
    return Scene(np.linspace(0, 1, 5), (), rotation(np.array(turn)), SHIFT, None)


def ball(count=400, radius=0.1):
    way = np.random.default_rng(0).normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    return radius * way, lambda p: (p**2).sum(-1) < radius**2


def test_of_a_ball_the_cap_before_its_horizon_is_seen():
    surface, inside = ball()
    eye = SHIFT + np.array([0.5, 0.0, 0.0])
    seen = facing_of_volume(surface, inside, scene(), eye[None])
    # the horizon of a ball is where the tangent meets the eye
    np.testing.assert_allclose(surface[seen, 0].min(), 0.1**2 / 0.5, atol=0.01)
    assert not seen[surface[:, 0] < 0.1**2 / 0.5 - 0.01].any()


def test_a_solid_that_is_turned_shows_another_side_and_two_eyes_see_more():
    surface, inside = ball()
    eye = SHIFT + np.array([0.5, 0.0, 0.0])
    turned = facing_of_volume(surface, inside, scene((0.0, 0.0, np.pi)), eye[None])
    assert surface[turned, 0].max() < 0.0
    both = facing_of_volume(surface, inside, scene(), np.stack([eye, SHIFT - np.array([0.5, 0.0, 0.0])]))
    assert both.mean() > 1.5 * turned.mean()


def test_what_is_behind_another_limb_is_not_seen():
    # two blocks side by side along x, seen along x: the inner face of the farther one is hidden
    def inside(p):
        within = (np.abs(p[..., 1:]) < 0.05).all(-1)
        return within & ((np.abs(p[..., 0] - 0.1) < 0.02) | (np.abs(p[..., 0] + 0.1) < 0.02))

    faces = np.array([[0.12, 0.0, 0.0], [0.08, 0.0, 0.0], [-0.08, 0.0, 0.0], [-0.12, 0.0, 0.0]])
    seen = facing_of_volume(faces, inside, scene(), (SHIFT + np.array([1.0, 0.0, 0.0]))[None])
    assert seen.tolist() == [True, False, False, False]


def test_of_a_rope_the_half_that_faces_the_eye_is_seen():
    along = np.linspace(0, 0.5, 40)
    line = np.stack([along, 0 * along, 0 * along], -1)
    angle = np.random.default_rng(1).uniform(0, 2 * np.pi, 40)
    skin = line + 0.01 * np.stack([0 * angle, np.cos(angle), np.sin(angle)], -1)
    seen = facing_of_line(skin, line, np.array([[0.25, 0.0, 3.0]]))
    assert (skin[seen, 2] > 0.0).all()
    assert (skin[~seen, 2] < 1e-3).all()


def test_one_or_two_cameras_stand_apart():
    eyes = [cameras((1.0, 0.0, 0.5), scene(), np.random.default_rng(seed)) for seed in range(20)]
    assert {len(each) for each in eyes} == {1, 2}
    for each in eyes:
        np.testing.assert_allclose(each[0], [1.3, -0.2, 0.5])
        flat = (each - SHIFT)[:, :2]
        angle = np.rad2deg(np.arctan2(flat[:, 1], flat[:, 0]))
        if len(each) == 2:
            assert 60 - 1e-9 <= abs(angle[1] - angle[0]) <= 120 + 1e-9


def test_only_those_points_are_kept_with_what_acts_on_them():
    motion = Motion(np.zeros((3, 4, 3)), {"wind": np.arange(4.0)}, np.zeros((3, 2, 3)), np.zeros((0, 4)))
    some = kept(motion, np.array([True, False, True, False]))
    assert some.points.shape == (3, 2, 3)
    assert some.acts["wind"].tolist() == [0.0, 2.0]


def test_worlds_that_are_seen_from_a_side_show_some_points_of_those_seen_around():
    wanted = Wanted(("null",))
    index = next(i for i in range(30) if _kind(i, wanted) == "solid")
    around = make(3, "dev", index, "mujoco", wanted)[0]["points"]
    first, second, label = make(3, "dev", index, "mujoco", wanted, tracked="side")
    assert label["kind"] == "solid"
    assert 0.2 * around.shape[1] < first["points"].shape[1] < 0.95 * around.shape[1]
    assert second["points"].shape[1] == first["points"].shape[1]
    sheet = next(i for i in range(30) if _kind(i, wanted) == "sheet")
    np.testing.assert_array_equal(
        make(3, "dev", sheet, "mujoco", wanted)[0]["points"],
        make(3, "dev", sheet, "mujoco", wanted, tracked="side")[0]["points"],
    )


def _kind(index, wanted):
    return draw_recipe(3, "dev", index, 0, wanted).world.shape.kind
