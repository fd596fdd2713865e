from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from model.bundle import TwinBundle
from model.errors import InputError
from model.observe.clip import choose_points, lift_tracks, observe_clip
from model.schema import CameraRecord
from model.segmentation import ClassicalSegmenter
from model.tracking import OpenCVTracker
from model.types import Camera, Frames, Masks, Prompt, Tracks
from model.views import look_at

SIZE = (240, 320)


@pytest.fixture
def bundle(twin_path: Path) -> TwinBundle:
    return TwinBundle.load(twin_path)


@pytest.fixture
def camera(bundle: TwinBundle) -> Camera:
    middle = bundle.topology.points.mean(axis=0).astype(np.float64)
    return look_at(middle + np.array([0.0, -0.6, 0.2]), middle, 500.0, SIZE[1], SIZE[0])


@pytest.fixture
def filmed(bundle: TwinBundle, camera: Camera) -> TwinBundle:
    record = CameraRecord.model_validate(
        {
            "intrinsics": camera.intrinsics.tolist(),
            "world_from_camera": camera.world_from_camera.tolist(),
            "width": SIZE[1],
            "height": SIZE[0],
        }
    )
    source = bundle.manifest.source.model_copy(update={"camera": record, "keyframe": 1, "frames": 6})
    return replace(bundle, manifest=bundle.manifest.model_copy(update={"source": source}))


def test_perfect_tracks_are_lifted_onto_the_twin(filmed: TwinBundle, camera: Camera):
    mask = np.ones(SIZE, bool)
    chosen, queries = choose_points(filmed, camera, mask)
    assert 5 <= len(chosen) < len(filmed.gaussians), "the far side is not seen"
    np.testing.assert_allclose(queries, camera.project(filmed.gaussians.means[chosen])[0], atol=1e-3)
    trajectory = filmed.rollout()
    # Each Gaussian of this bundle hangs on the one point it lies at.
    moved = trajectory.points[:, filmed.topology.binding_index[chosen, 0]]
    frames = len(moved) + 1
    pixels = np.concatenate([queries[None], camera.project(moved)[0]]).astype(np.float32)
    visible = np.ones((frames, len(chosen)), bool)
    visible[3, 2] = False
    inside = np.ones((frames, *SIZE), bool)
    x, y = np.round(pixels[4, 0]).astype(int)
    inside[4, y, x] = False
    masks = Masks(inside, ~inside, keyframe=1)
    times = np.arange(len(moved)) / 30.0
    with pytest.warns(UserWarning, match="depth comes from the twin"):
        seen = lift_tracks(filmed, camera, chosen, Tracks(pixels, visible), masks, times)
    assert filmed.controls is not None
    np.testing.assert_allclose(seen.controllers, filmed.controls, atol=1e-6)
    unseen = np.isnan(seen.points[..., 0])
    np.testing.assert_array_equal(np.argwhere(unseen), [[2, 2], [3, 0]])
    np.testing.assert_allclose(seen.points[~unseen], moved[~unseen], atol=2e-4)
    topology = filmed.topology
    np.testing.assert_array_equal(seen.parts, topology.part[topology.binding_index[chosen, 0]])
    one = replace(filmed, topology=replace(topology, part=np.zeros_like(topology.part)))
    with pytest.warns(UserWarning, match="depth comes from the twin"):
        seen = lift_tracks(one, camera, chosen, Tracks(pixels, visible), masks, times)
    assert seen.parts is None, "of one part: thirds of it say more"


def test_a_camera_of_another_size_is_fitted(filmed: TwinBundle, camera: Camera):
    _, queries = choose_points(filmed, camera, np.ones(SIZE, bool))
    _, half = choose_points(filmed, camera, np.ones((SIZE[0] // 2, SIZE[1] // 2), bool))
    np.testing.assert_allclose((half[0] + 0.5) * 2 - 0.5, queries[0], atol=1e-3)


def test_refuses_another_clip_and_a_twin_without_camera(bundle: TwinBundle, camera: Camera, tmp_path: Path):
    with pytest.raises(InputError, match="no point of the twin is seen"):
        choose_points(bundle, camera, np.zeros(SIZE, bool))
    told: list[str] = []
    with pytest.raises(InputError, match=r"source\.camera is missing"):
        observe_clip(
            tmp_path / "c.mp4",
            bundle,
            ClassicalSegmenter(),
            OpenCVTracker(),
            lambda stage, _: told.append(stage),
        )
    assert told == [], "refused before any work"


def test_what_is_lost_after_the_keyframe_is_refused(filmed: TwinBundle, tmp_path: Path):
    """Who follows the clip in the end finds nothing that a diagnosis could be of."""
    for index in range(6):
        cv2.imwrite(str(tmp_path / f"{index}.png"), np.zeros((*SIZE, 3), np.uint8))

    class Whole(ClassicalSegmenter):
        def __call__(self, frames: Frames, prompt: Prompt) -> Masks:
            inside = np.ones((len(frames.images), *SIZE), bool)
            return Masks(inside, ~inside, keyframe=1)

    class Lost(OpenCVTracker):
        def __call__(self, frames: Frames, queries: np.ndarray, keyframe: int) -> Tracks:
            visible = np.zeros((len(frames.images), len(queries)), bool)
            visible[keyframe] = True
            return Tracks(np.repeat(queries[None], len(visible), axis=0), visible)

    with (
        pytest.raises(InputError, match="points: expected points seen in 2 frames, found only one"),
        pytest.warns(UserWarning, match="depth comes from the twin"),
    ):
        observe_clip(tmp_path, filmed, Whole(), Lost(), lambda stage, _: None, fps=30.0)


def test_a_folder_of_images_is_observed_at_the_rate_that_was_asked_for(filmed: TwinBundle, tmp_path: Path):
    for index in range(6):
        cv2.imwrite(str(tmp_path / f"{index}.png"), np.zeros((*SIZE, 3), np.uint8))

    class Blind(ClassicalSegmenter):
        def __call__(self, frames: Frames, prompt: Prompt) -> Masks:
            raise InputError(f"{frames.fps:.1f} frames per second")

    with (
        pytest.raises(InputError, match=r"12\.0 frames per second"),
        pytest.warns(UserWarning, match=r"12 frames per second here, 30 in the twin; .* --fps"),
    ):
        observe_clip(tmp_path, filmed, Blind(), OpenCVTracker(), lambda stage, _: None, fps=12.0)


def test_a_clip_of_another_length_is_not_the_one_of_the_twin(filmed: TwinBundle, tmp_path: Path):
    source = filmed.manifest.source.model_copy(update={"sha256": "0" * 64})
    filmed = replace(filmed, manifest=filmed.manifest.model_copy(update={"source": source}))
    for index in range(7):
        cv2.imwrite(str(tmp_path / f"{index}.png"), np.zeros((*SIZE, 3), np.uint8))
    with pytest.raises(InputError, match="twin was made from, of 6 frames, found another one, of 7"):
        observe_clip(tmp_path, filmed, ClassicalSegmenter(), OpenCVTracker(), lambda stage, _: None, fps=30.0)
