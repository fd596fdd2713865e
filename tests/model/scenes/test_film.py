import hashlib
import json
from dataclasses import replace

import av
import cv2
import numpy as np
import pytest

from model.errors import InputError
from model.scenes import film
from model.skinning import bind
from model.types import Gaussians


@pytest.fixture(scope="module")
def case(make_case):
    """The foam bar, filled with Gaussians."""
    bar = make_case(frames=4, lift=0.1)
    axes = [np.arange(low, high, 0.007) for low, high in ((-0.006, 0.147), (-0.006, 0.048), (0.002, 0.048))]
    means = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3).astype(np.float32)
    ones = np.ones(len(means), np.float32)
    upright = np.tile(np.array([1, 0, 0, 0], np.float32), (len(means), 1))
    body = Gaussians(means, 0.004 * np.ones_like(means), upright, 0.9 * ones, 0 * means, 0.007**3 * ones)
    index, weight = bind(means, bar.topology.points, springs=bar.topology.springs)
    topology = replace(bar.topology, binding_index=index, binding_weight=weight)
    return replace(bar, gaussians=body, topology=topology)


@pytest.fixture(scope="module")
def folder(case, tmp_path_factory):
    folder = tmp_path_factory.mktemp("film")
    film.film_case(case, folder / "a", (160, 120), seed=3)
    return folder


def without_hands(case):
    nothing = np.zeros((4, 0, 3), np.float32)
    topology = replace(
        case.topology,
        controller_points=nothing[0],
        controller_springs=np.zeros((0, 2), np.int32),
        controller_rest_length=np.zeros(0, np.float32),
    )
    return replace(case, topology=topology, observation=replace(case.observation, controllers=nothing))


def masks(folder, name):
    return np.stack([cv2.imread(str(path), 0) > 0 for path in sorted((folder / name).iterdir())])


def test_the_folder_holds_what_the_record_says(case, folder):
    record = json.loads((folder / "a" / "film.json").read_text())
    assert record["schema"] == "matphys.film/1"
    assert record["materials"] == ["fabric", "leather"]
    assert (record["frames"], record["width"], record["height"]) == (4, 160, 120)
    for name, digest in record["sha256"].items():
        assert hashlib.sha256((folder / "a" / name).read_bytes()).hexdigest() == digest
    with av.open(str(folder / "a" / "film.mp4")) as container:
        assert sum(1 for _ in container.decode(video=0)) == 4


def test_object_and_hand_are_in_the_picture_and_touch(folder):
    things, hands = masks(folder / "a", "object"), masks(folder / "a", "hand")
    assert things.shape == hands.shape == (4, 120, 160)
    assert not (things & hands).any()
    for thing, hand in zip(things, hands, strict=True):
        assert 0.02 < thing.mean() < 0.5
        assert hand.mean() > 0.003
        assert (cv2.dilate(thing.astype(np.uint8), np.ones((5, 5))) > 0)[hand].any()


def test_tracks_lie_on_the_object_where_they_are_seen(case, folder):
    things = masks(folder / "a", "object")
    with np.load(folder / "a" / "tracks.npz") as tracks:
        pixels, visible, depth = tracks["pixels"], tracks["visible"], tracks["depth"]
        np.testing.assert_array_equal(tracks["points"], case.complete)
    assert visible.shape == pixels.shape[:2] == (4, 40)
    assert 0.15 < visible.mean() < 0.9  # the back of the bar is hidden
    for thing, places, seen in zip(things, pixels, visible, strict=True):
        x, y = places[seen].round().astype(int).T
        assert thing[y, x].all()
    # In the middle of the bar, what is seen is nearer than what is not.
    assert np.median(depth[0][visible[0]]) < np.median(depth[0][~visible[0]])


def test_equal_seeds_give_equal_films_and_others_another_room(case, folder):
    film.film_case(case, folder / "b", (160, 120), seed=3)
    for name in ("film.mp4", "tracks.npz", "film.json", "camera.json"):
        assert (folder / "a" / name).read_bytes() == (folder / "b" / name).read_bytes()
    one, other = (film.set_scene(without_hands(case), (160, 120), seed) for seed in (3, 4))
    assert one.looks == other.looks
    assert one.setting != other.setting


def test_another_interaction_shows_the_same_object_elsewhere(case):
    one = film.set_scene(without_hands(case), (160, 120), 3)
    other = film.set_scene(replace(without_hands(case), name="bar-0-push", interaction="push"), (160, 120), 3)
    assert one.looks == other.looks
    np.testing.assert_array_equal(one.body.gaussians.colors, other.body.gaussians.colors)
    assert np.abs(one.camera.position - other.camera.position).max() > 0.01


def test_the_body_is_drawn_where_its_points_are(case):
    scene = film.set_scene(without_hands(case), (160, 120), 0)
    outside = case.rest[:, 2] > 0.034  # the upper layer of mass points, and what is observed beside it
    off = np.linalg.norm(scene.body.gaussians.means[:, None] - case.rest[outside], axis=2).min(axis=0)
    assert np.median(off) < 0.006
    assert off.max() < 0.015


def test_a_camera_of_the_case_is_the_films(case):
    case = without_hands(case)
    camera = film.set_scene(case, (160, 120), 0).camera
    given = film.set_scene(replace(case, camera=camera), (80, 60), 5).camera
    assert (given.width, given.height) == (80, 60)
    np.testing.assert_allclose(given.position, camera.position)


def test_a_case_without_looks_or_motion_is_refused(case, tmp_path):
    for lacking in (replace(case, gaussians=None), replace(case, complete=None)):
        with pytest.raises(InputError, match="needs its Gaussians and the motion"):
            film.film_case(lacking, tmp_path, (80, 60))
