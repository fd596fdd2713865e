import io
from dataclasses import replace

import av
import cv2
import numpy as np
import pytest

from model.preview import preview, render_rollout, silhouette_iou, write_rollout_video
from model.rendering import Renderer, best_renderer
from model.skinning import bind
from model.types import (
    Calibration,
    Frames,
    Gaussians,
    Masks,
    Parameter,
    Parameters,
    Topology,
    Trajectory,
)
from model.views import look_at

CAMERA = look_at(np.array([0.0, -0.8, 0.6]), np.array([0.0, 0.0, 0.05]), 150.0, 120, 90)
FRAMES, KEYFRAME = 7, 2


def ball(count=600):
    """A ball of Gaussians on 27 points."""
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    means = (directions * 0.08 * rng.uniform(0, 1, (count, 1)) ** (1 / 3) + [0, 0, 0.08]).astype(np.float32)
    grid = np.stack(np.meshgrid(*[[-0.05, 0, 0.05]] * 3), axis=-1).reshape(-1, 3)
    points = (grid + np.array([0, 0, 0.08])).astype(np.float32)
    first, second = np.triu_indices(27, 1)
    length = np.linalg.norm(points[first] - points[second], axis=1)
    near = length < 0.09
    springs = np.stack([first, second], axis=1)[near].astype(np.int32)
    gaussians = Gaussians(
        means=means,
        scales=np.full((count, 3), 0.012, np.float32),
        quaternions=np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1)),
        opacities=np.full(count, 0.9, np.float32),
        colors=np.tile(np.array([0.9, 0.2, 0.1], np.float32), (count, 1)),
        volumes=np.full(count, 2e-3 / count, np.float32),
    )
    index, weight = bind(means, points, springs=springs)
    topology = Topology(
        points=points, mass=np.ones(27, np.float32), springs=springs, rest_length=length[near],
        part=np.zeros(27, np.int32), binding_index=index, binding_weight=weight,
        controller_points=np.zeros((0, 3), np.float32), controller_springs=np.zeros((0, 2), np.int32),
        controller_rest_length=np.zeros(0, np.float32),
    )  # fmt: skip
    return gaussians, topology


def moving(topology, count=FRAMES - KEYFRAME, fps=30.0):
    shift = np.outer(np.arange(count) * 0.02, [1, 0, 0.5])
    points = (topology.points + shift[:, None]).astype(np.float32)
    return Trajectory(np.arange(count) / fps, points)


@pytest.fixture(scope="module")
def scene():
    """A clip rendered from the very motion that the twin replays."""
    gaussians, topology = ball()
    trajectory = moving(topology)
    still = np.repeat(trajectory.points[:1], KEYFRAME, axis=0)
    shown = render_rollout(
        gaussians, topology, np.concatenate([still, trajectory.points]), CAMERA, best_renderer()
    )
    images, masks = [], []
    for frame in shown:
        image = frame.color + (1 - frame.alpha[..., None]) * 0.7
        images.append((image * 255).astype(np.uint8))
        masks.append(frame.alpha > 0.5)
    frames = Frames(np.stack(images), np.arange(FRAMES) / 30, "clip", "0" * 64)
    hand = np.zeros((FRAMES, 90, 120), bool)
    calibration = Calibration(CAMERA, (0.0, 0.0, -9.81), 0.0, "told", "told", "told")
    return frames, Masks(np.stack(masks), hand, KEYFRAME), calibration, gaussians, topology, trajectory


def decoded(data):
    with av.open(io.BytesIO(data)) as container:
        return np.stack([frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)])


def test_rollout_moves_the_twin(scene):
    *_, gaussians, topology, trajectory = scene
    frames = list(render_rollout(gaussians, topology, trajectory.points, CAMERA, best_renderer()))
    for moment, frame in enumerate(frames):
        expected = gaussians.means + moment * 0.02 * np.array([1, 0, 0.5])
        np.testing.assert_allclose(frame.means, expected, atol=1e-6)
        y, x = np.nonzero(frame.alpha > 0.5)
        center = CAMERA.project(expected.mean(axis=0))[0]
        np.testing.assert_allclose([x.mean(), y.mean()], center, atol=1.0)


def test_colours_are_drawn_within_what_a_picture_has(scene):
    gaussians, topology, trajectory = scene[3:6]
    beyond, within = (
        next(render_rollout(each, topology, trajectory.points[:1], CAMERA, best_renderer())).color
        for each in (
            replace(gaussians, colors=gaussians.colors + 5.0),
            replace(gaussians, colors=np.ones_like(gaussians.colors)),
        )
    )
    np.testing.assert_array_equal(beyond, within)


def test_preview_shows_the_clip_beside_a_twin_that_agrees(scene):
    frames, masks, calibration, gaussians, topology, trajectory = scene
    controls = trajectory.points[:, :2]
    found = preview(frames, masks, calibration, gaussians, topology, trajectory, controls, best_renderer())
    assert found.overlap.shape == (FRAMES - KEYFRAME,)
    assert found.overlap.min() > 0.98
    movie = decoded(found.video)
    assert movie.shape == (FRAMES - KEYFRAME, 90, 240, 3)
    for moment, picture in enumerate(movie.astype(float)):
        clip, twin = picture[30:, :120], picture[30:, 120:]
        assert np.abs(clip - frames.images[KEYFRAME + moment, 30:]).mean() < 12
        red = (twin[..., 0] - twin[..., 2]) > 60
        mask = cv2.erode(masks.object[KEYFRAME + moment].astype(np.uint8), np.ones((7, 7)))[30:] > 0
        assert red[mask].mean() > 0.8
        outside = cv2.dilate(masks.object[KEYFRAME + moment].astype(np.uint8), np.ones((15, 15)))[30:] == 0
        assert not red[outside].any()


def test_preview_is_the_same_every_time(scene):
    first, second = (preview(*scene, None, best_renderer()) for _ in range(2))
    assert first.video == second.video
    np.testing.assert_array_equal(first.overlap, second.overlap)


def test_a_twin_that_stays_behind_overlaps_less_and_less(scene):
    *rest, trajectory = scene
    frozen = Trajectory(trajectory.times, np.repeat(trajectory.points[:1], len(trajectory.points), axis=0))
    overlap = preview(*rest, frozen, None, best_renderer()).overlap
    assert overlap[0] > 0.98
    assert (np.diff(overlap) < 0).all()


def test_a_shorter_or_coarser_rollout_is_matched_by_time(scene):
    *rest, trajectory = scene
    halved = Trajectory(trajectory.times[::2], trajectory.points[::2])
    overlap = preview(*rest, halved, None, best_renderer()).overlap
    assert overlap.shape == (5,)
    assert (overlap[::2] > 0.98).all()
    assert (overlap[1::2] < 0.98).all()
    short = Trajectory(trajectory.times[:2], trajectory.points[:2])
    assert preview(*rest, short, None, best_renderer()).overlap.shape == (2,)
    single = Trajectory(trajectory.times[:1], trajectory.points[:1])
    assert preview(*rest, single, None, best_renderer()).overlap.shape == (1,)


def test_silhouettes_ignore_what_the_hand_hides():
    alpha, mask, hand = np.zeros((10, 10), np.float32), np.zeros((10, 10), bool), np.zeros((10, 10), bool)
    alpha[2:8, 2:8] = 0.9
    mask[2:8, 2:5] = True
    assert silhouette_iou(alpha, mask, hand) == pytest.approx(0.5)
    hand[2:8, 5:8] = True
    assert silhouette_iou(alpha, mask, hand) == pytest.approx(1.0)
    assert silhouette_iou(np.zeros_like(alpha), np.zeros_like(mask), hand) == 1.0
    assert silhouette_iou(np.zeros_like(alpha), mask, hand) == 0.0


class Bundle:
    """What a rollout video needs of a bundle."""

    def __init__(self, camera, ground):
        self.gaussians, self.topology = ball()
        self.camera = camera
        heights = {} if ground is None else {"ground_height": Parameter(ground, "m", "predicted")}
        empty = np.zeros(0, np.float32)
        self.parameters = Parameters(stiffness=empty, controller_stiffness=empty, globals=heights)


@pytest.mark.parametrize(("camera", "ground"), [(CAMERA, 0.0), (None, 0.0), (None, None)])
def test_rollout_video_shows_the_twin_alone(tmp_path, camera, ground):
    bundle, path = Bundle(camera, ground), tmp_path / "new" / "rollout.mp4"
    write_rollout_video(path, bundle, moving(bundle.topology), best_renderer())
    movie = decoded(path.read_bytes()).astype(float)
    assert len(movie) == 5
    red = movie[..., 0] - movie[..., 2] > 60
    assert red.any(axis=(1, 2)).all()
    columns = [np.nonzero(frame)[1].mean() for frame in red]
    assert (np.diff(columns) > 0).all()
    assert sorted(path.parent.iterdir()) == [path]


def test_a_failed_rendering_leaves_no_file(tmp_path):
    class Broken(Renderer):
        name = "broken"

        def forward(self, *arguments):
            raise RuntimeError("broken")

    bundle = Bundle(None, 0.0)
    with pytest.raises(RuntimeError, match="broken"):
        write_rollout_video(tmp_path / "rollout.mp4", bundle, moving(bundle.topology), Broken())
    assert not list(tmp_path.iterdir())
