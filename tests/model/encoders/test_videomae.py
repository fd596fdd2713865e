"""VideoMAE from a folder of weights; the weights here are tiny and random, in the hub's format."""

import hashlib
import sys
import types
from dataclasses import replace

import numpy as np
import pytest
import torch

from model.encoders.motion import MotionClip
from model.encoders.videomae import FRAMES, VideoMaeEncoder
from model.encoders.weights_folder import IMAGENET_MEAN, IMAGENET_STD
from model.errors import InputError
from model.predictor.motion import describe_motion
from model.types import Camera

transformers = pytest.importorskip("transformers")
SMALL = {
    "image_size": 224,
    "patch_size": 56,
    "num_frames": 16,
    "tubelet_size": 2,
    "hidden_size": 24,
    "num_hidden_layers": 2,
    "num_attention_heads": 2,
    "intermediate_size": 32,
}
ROWS = 4


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    torch.manual_seed(0)
    network = transformers.VideoMAEModel(transformers.VideoMAEConfig(**SMALL))
    folder = tmp_path_factory.mktemp("videomae")
    network.save_pretrained(folder)
    return folder, network.eval()


@pytest.fixture(scope="module")
def encoder(checkpoint):
    return VideoMaeEncoder(checkpoint[0])


def clip(frames=FRAMES, count=5, seed=0):
    """Points at the depth 1 m, where 1 m is 100 px, in front of a camera that looks along +z."""
    rng = np.random.default_rng(seed)
    rest = np.concatenate([rng.uniform(0.2, 1.4, (count, 2)), np.ones((count, 1))], axis=1).astype(np.float32)
    moved = rest + np.linspace(0.0, 0.2, frames)[:, None, None].astype(np.float32) * [1.0, 0.0, 0.0]
    camera = Camera(np.diag([100.0, 100.0, 1.0]), np.eye(4), 200, 160)
    return MotionClip(
        times=np.arange(frames) / 30.0,
        rest=rest,
        points=moved.astype(np.float32),
        part=np.zeros(count, np.int64),
        parts=1,
        controllers=np.zeros((frames, 0, 3), np.float32),
        gravity=(0.0, 0.0, -9.81),
        camera=camera,
        images=rng.integers(0, 256, (frames, 160, 200, 3), dtype=np.uint8),
    )


def test_sizes_follow_the_checkpoint(encoder):
    found = encoder(clip())
    assert (encoder.dim, encoder.global_dim) == (24, 24)
    assert found.points.shape == (5, 24)
    assert found.parts.shape == (1, 0)
    assert found.whole.shape == (24,)


def test_features_are_the_tokens_under_the_point(checkpoint):
    """The path spans 224 px of the image, so that nothing is resized; one point stays in a cell's middle."""
    rest = np.ones((3, 3), np.float32)
    middle, half = np.array([111.5, 111.5]), 80.0
    rest[:, :2] = np.array([middle - half, middle + half, [139.5, 83.5]]) / 100.0
    rng = np.random.default_rng(1)
    images = rng.integers(0, 256, (FRAMES, 230, 230, 3), dtype=np.uint8)
    base = clip(count=3)
    still = replace(
        base,
        rest=rest,
        points=np.repeat(rest[None], FRAMES, axis=0),
        images=images,
        camera=Camera(np.diag([100.0, 100.0, 1.0]), np.eye(4), 230, 230),
    )
    found = VideoMaeEncoder(checkpoint[0])(still)
    square = images[:, :224, :224] / 255.0
    normal = ((square - IMAGENET_MEAN) / IMAGENET_STD).transpose(0, 3, 1, 2).astype(np.float32)
    with torch.no_grad():
        batch = torch.from_numpy(normal).reshape(2, 16, 3, 224, 224)
        tokens = checkpoint[1](pixel_values=batch).last_hidden_state.reshape(16, ROWS, ROWS, 24)
    # (139.5, 83.5) is the centre of the cell in row 1, column 2
    expected = torch.nn.functional.layer_norm(tokens[:, 1, 2].mean(dim=0), (24,))
    np.testing.assert_allclose(found.points[2], expected.numpy(), atol=2e-2)
    whole = torch.nn.functional.layer_norm(tokens.mean(dim=(0, 1, 2)), (24,))
    np.testing.assert_allclose(found.whole, whole.numpy(), atol=2e-2)


def test_what_happens_under_a_point_matters_to_it(encoder):
    first = clip()
    other = clip(seed=1)
    same_places = replace(other, rest=first.rest, points=first.points)
    assert np.abs(encoder(first).points - encoder(same_places).points).max() > 1e-3


def test_gaps_are_bridged(encoder):
    whole = clip()
    holes = whole.points.copy()
    holes[5:12, 0] = np.nan
    holes[:, 1] = np.nan
    found = encoder(replace(whole, points=holes))
    np.testing.assert_allclose(found.points[0], encoder(whole).points[0], atol=1e-3)
    assert np.isfinite(found.points).all()


def test_short_clips_are_stretched_to_the_frames_it_knows(encoder):
    assert np.isfinite(encoder(clip(frames=9)).points).all()


def test_weights_are_the_hash_of_the_file(checkpoint, encoder):
    content = (checkpoint[0] / "model.safetensors").read_bytes()
    assert encoder.weights == hashlib.sha256(content).hexdigest()


def test_nothing_of_it_learns(encoder):
    assert not any(parameter.requires_grad for parameter in encoder.parameters())


def test_folder_may_come_from_the_environment(checkpoint, monkeypatch):
    monkeypatch.setenv("MATPHYS_VIDEOMAE", str(checkpoint[0]))
    assert VideoMaeEncoder().dim == 24


def test_without_a_folder_it_says_which_variable_to_set(monkeypatch):
    monkeypatch.delenv("MATPHYS_VIDEOMAE", raising=False)
    with pytest.raises(InputError, match="MATPHYS_VIDEOMAE"):
        VideoMaeEncoder()


def test_a_name_is_had_from_the_hub(checkpoint, monkeypatch):
    asked = []

    def snapshot_download(name, allow_patterns):
        asked.append(name)
        return str(checkpoint[0])

    hub = types.SimpleNamespace(snapshot_download=snapshot_download)
    monkeypatch.setitem(sys.modules, "huggingface_hub", hub)
    assert VideoMaeEncoder("someone/videomae-tiny").dim == 24
    assert asked == ["someone/videomae-tiny"]


def test_a_name_that_the_hub_does_not_have_gets_one_line(monkeypatch):
    def snapshot_download(name, allow_patterns):
        raise OSError("no such\nrepository")

    monkeypatch.setitem(
        sys.modules, "huggingface_hub", types.SimpleNamespace(snapshot_download=snapshot_download)
    )
    with pytest.raises(InputError, match="no such repository") as caught:
        VideoMaeEncoder("someone/nothing")
    assert "\n" not in str(caught.value)


def test_another_model_is_refused(tmp_path):
    (tmp_path / "config.json").write_text('{"model_type": "vit"}')
    with pytest.raises(InputError, match="'vit' model; give one of type videomae"):
        VideoMaeEncoder(tmp_path)


def test_frames_that_do_not_fill_32_are_refused(tmp_path):
    config = transformers.VideoMAEConfig(**{**SMALL, "num_frames": 10})
    transformers.VideoMAEModel(config).save_pretrained(tmp_path)
    with pytest.raises(InputError, match="10 frames"):
        VideoMaeEncoder(tmp_path)


def test_without_images_it_says_so(encoder):
    with pytest.raises(InputError, match="without images"):
        encoder(replace(clip(), images=None))


def test_it_describes_the_mass_points_of_a_case(make_case, encoder):
    case = make_case(frames=12)
    pose = np.eye(4)
    pose[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    pose[:3, 3] = (0.07, -0.8, 0.1)
    camera = Camera(np.array([[150.0, 0, 60], [0, 150, 45], [0, 0, 1]]), pose, 120, 90)
    images = np.random.default_rng(0).integers(0, 256, (12, 90, 120, 3), dtype=np.uint8)
    found = describe_motion(
        case.topology, "solid", case.rest, case.anchors, case.observation, camera, 8, encoder, images
    )
    assert found.points.shape == (len(case.topology.points), 24)
    later = images.copy()
    later[8:] = 0
    again = describe_motion(
        case.topology, "solid", case.rest, case.anchors, case.observation, camera, 8, encoder, later
    )
    np.testing.assert_array_equal(found.points, again.points)
