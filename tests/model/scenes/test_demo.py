import json

import av
import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from model.scenes import demo
from model.scenes.plush import GRIP
from model.scenes.table import table_view


@pytest.fixture(scope="module")
def scene():
    return demo.set_scene(np.random.default_rng(0))


@pytest.fixture(scope="module")
def filmed(scene):
    return list(demo.film(scene, np.random.default_rng(1), masks=True))


def test_the_animal_is_one_connected_piece(scene):
    count = len(scene.topology.points)
    first, second = scene.topology.springs.T
    graph = coo_array((np.ones(len(first)), (first, second)), shape=(count, count))
    assert connected_components(graph, directed=False)[0] == 1
    assert 0.05 < scene.topology.mass.sum() < 0.5


@pytest.mark.slow
def test_the_hand_lifts_one_leg_and_the_rest_stays_on_the_table(scene):
    played = demo.act(scene)
    held = np.linalg.norm(scene.topology.points - GRIP, axis=1) < demo.GRIP_REACH
    follows = played.points[:, held].mean(axis=1) - played.points[0, held].mean(axis=0)
    np.testing.assert_allclose(follows, played.grip - played.grip[0], atol=0.03)
    assert played.grip[:, 2].max() > GRIP[2] + 0.12
    assert played.points[..., 2].min() > -1e-3
    assert (played.points[..., 2].min(axis=1) < 0.01).all()
    # It was at rest before: the first frames are still.
    assert np.linalg.norm(played.points[3] - played.points[0], axis=1).max() < 2e-3


def test_object_and_hand_are_seen_touching(filmed):
    for picture, thing, hand in filmed:
        assert picture.shape == (480, 640, 3)
        assert not (thing & hand).any()
        assert 0.04 < thing.mean() < 0.3
        assert 0.005 < hand.mean() < 0.2
        assert hand[0].any()  # the arm comes from the top
        assert (cv2.dilate(thing.astype(np.uint8), np.ones((5, 5))) > 0)[hand].any()
        border = np.concatenate([thing[0], thing[-1], thing[:, 0], thing[:, -1]])
        assert not border.any()


def test_skin_looks_like_skin_and_the_animal_does_not(filmed):
    picture, thing, hand = filmed[0]
    red, green, blue = (picture[..., channel].astype(float) for channel in range(3))
    skin = (red > green + 15) & (green > blue)
    hand[:40] = False  # the sleeve
    assert skin[hand].mean() > 0.8
    assert skin[thing].mean() < 0.2


def test_the_sensor_is_noisy_and_the_rest_is_not(scene, filmed):
    ((again, *_),) = demo.film(scene, np.random.default_rng(1), masks=False)
    np.testing.assert_array_equal(filmed[0][0], again)
    background, _ = table_view(scene.camera, np.random.default_rng(1))
    noise = filmed[0][0][440:].astype(float) - 255 * background[440:]  # in front of all shadows
    assert np.abs(noise.mean()) < 1
    assert 1.2 < noise.std() < 2.2


def test_the_table_ends_before_the_room(scene):
    view, on_table = table_view(scene.camera, np.random.default_rng(0))
    assert on_table[240:].min() == 1
    assert on_table[0].max() < 0.01
    assert view[300:].mean() > view[:20].mean() + 0.2
    assert 0.005 < view[300:].std(axis=(0, 1)).mean() < 0.15


@pytest.mark.slow
def test_the_whole_clip_with_its_truth(tmp_path):
    demo.make_demo_clip(tmp_path / "demo.mp4", truth_dir=tmp_path / "truth")
    demo.make_demo_clip(tmp_path / "again.mp4")
    assert (tmp_path / "demo.mp4").read_bytes() == (tmp_path / "again.mp4").read_bytes()
    with av.open(str(tmp_path / "demo.mp4")) as container:
        assert sum(1 for _ in container.decode(video=0)) == demo.FRAMES
    record = json.loads((tmp_path / "truth" / "camera.json").read_text())
    assert np.shape(record["world_from_camera"]) == (4, 4)
    with np.load(tmp_path / "truth" / "controllers.npz") as controllers:
        assert controllers["controllers"].shape == (demo.FRAMES, 4, 3)
    for name in ("object", "hand"):
        files = sorted((tmp_path / "truth" / name).iterdir())
        assert len(files) == demo.FRAMES
        assert cv2.imread(str(files[0]), cv2.IMREAD_GRAYSCALE).max() == 255


def test_the_command_needs_a_place_to_write(tmp_path, monkeypatch):
    monkeypatch.setattr(demo, "act", lambda scene: scene)  # one frame will do
    (tmp_path / "file").write_text("in the way")
    refused = CliRunner().invoke(demo.main, [str(tmp_path / "file" / "demo.mp4")])
    assert refused.exit_code == 2
    assert refused.stderr.count("\n") == 1
    done = CliRunner().invoke(demo.main, [str(tmp_path / "demo.mp4"), "--truth", str(tmp_path / "truth")])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "demo.mp4").stat().st_size > 1000
    assert (tmp_path / "truth" / "object" / "0000.png").exists()
