from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from model.controllers import find_controllers, read_controllers
from model.errors import InputError
from model.types import Calibration, Camera, Frames, Gaussians, Masks, Tracks

HEIGHT, WIDTH, COUNT = 120, 160, 24
FOCAL = 150.0


def camera(pitch=0.6, distance=1.0):
    """Looks down at the origin from the front: x to the right, y away, z up."""
    right = np.array([1.0, 0.0, 0.0])
    forward = np.array([0.0, np.cos(pitch), -np.sin(pitch)])
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = -distance * forward
    intrinsics = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])
    return Camera(intrinsics, pose, WIDTH, HEIGHT)


def calibration(ground=0.0):
    return Calibration(camera(), (0.0, 0.0, -9.81), ground, "", "", "")


def body():
    """A bar on the ground, 0.3 m along x, at z 0 … 0.03."""
    axes = (np.linspace(-0.15, 0.15, 31), np.linspace(-0.02, 0.02, 5), np.linspace(0.005, 0.025, 3))
    means = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3).astype(np.float32)
    count = len(means)
    return Gaussians(
        means=means,
        scales=np.full((count, 3), 0.005, np.float32),
        quaternions=np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
        opacities=np.full(count, 0.9, np.float32),
        colors=np.full((count, 3), 0.5, np.float32),
        volumes=np.full(count, 1e-6, np.float32),
    )


def scene(path, hand_from=0, keyframe=0, hands=("left",)):
    """The bar's mask stands still; hands at its ends move by `path` [T, 2] px; what they show, too."""
    pixels, _ = camera().project(body().means)
    low, high = np.floor(pixels.min(axis=0)).astype(int), np.ceil(pixels.max(axis=0)).astype(int)
    noise = gaussian_filter(np.random.default_rng(0).normal(size=(HEIGHT, WIDTH)), 1.2)
    ground = (120 + 200 * noise).clip(0, 255).astype(np.uint8)
    images, things, fists = [], [], []
    for index in range(COUNT):
        dx, dy = np.round(path[index]).astype(int)
        image, thing, fist = ground.copy(), np.zeros((HEIGHT, WIDTH), bool), np.zeros((HEIGHT, WIDTH), bool)
        moved = np.roll(ground[::-1], (dy, dx), axis=(0, 1))
        thing[low[1] : high[1], low[0] : high[0]] = True
        if index >= hand_from:
            for hand in hands:
                edge = low[0] - 21 if hand == "left" else high[0]
                box = (slice(low[1] - 8 + dy, high[1] + 8 + dy), slice(edge + dx, edge + 21 + dx))
                fist[box] = True
            # the object's end goes with the hand
            carried = np.zeros_like(thing)
            for hand in hands:
                start = low[0] if hand == "left" else high[0] - 15
                carried[low[1] + dy : high[1] + dy, start + dx : start + 15 + dx] = True
            thing |= carried
            image[fist | carried] = moved[fist | carried]
        images.append(np.repeat(image[..., None], 3, axis=2))
        things.append(thing & ~fist)
        fists.append(fist)
    frames = Frames(np.stack(images), np.arange(COUNT) / 30.0, "made", "")
    return frames, Masks(np.stack(things), np.stack(fists), keyframe)


def resting_tracks(count=12):
    """Of the right half of the bar, which does not move."""
    means = body().means
    chosen = means[(means[:, 0] > 0) & (means[:, 2] > 0.02)][:: 36 // count]
    pixels = camera().project(chosen)[0].astype(np.float32)
    return Tracks(np.repeat(pixels[None], COUNT, axis=0), np.ones((COUNT, len(pixels)), bool))


def no_tracks():
    return Tracks(np.zeros((COUNT, 0, 2), np.float32), np.zeros((COUNT, 0), bool))


class Follower:
    """A perfect tracker for `scene`: pixels of hands and of what they carry go with the path."""

    def __init__(self, path, works=True):
        self.path, self.works, self.calls = path, works, 0

    def __call__(self, frames, queries, keyframe):
        self.calls += 1
        first = round(float(frames.times[0]) * 30)
        path = self.path[first : first + len(frames.images)]
        points = queries[None] + (path - path[keyframe])[:, None]
        visible = np.full(points.shape[:2], self.works)
        visible[keyframe] = True
        return Tracks(points.astype(np.float32), visible)


def along(direction, total=30.0):
    return np.linspace(0, 1, COUNT)[:, None] * np.array(direction) * total


def find(path, tracks=None, works=True, ground=0.0, **options):
    frames, masks = scene(path, **options)
    found = no_tracks() if tracks is None else tracks
    return find_controllers(frames, masks, found, calibration(ground), body(), Follower(path, works))


def test_a_lift_keeps_the_depth_and_follows_the_image():
    path = along((0.0, -1.0))
    controllers = find(path)
    assert controllers.motion.shape == (COUNT, 6, 3)
    assert controllers.warnings == ()
    pixels, depth = camera().project(controllers.motion)
    np.testing.assert_allclose((pixels - pixels[0]).mean(axis=1), path, atol=1.0)
    np.testing.assert_allclose(depth.mean(axis=1), depth[0].mean(), rtol=1e-3)
    assert controllers.motion[-1, :, 2].mean() > 0.1


def test_the_grip_is_the_touched_end_of_the_object_on_the_keyframe():
    start = find(along((0.0, -1.0))).motion[0]
    means = body().means
    nearest = np.linalg.norm(start[:, None] - means[None], axis=2).min(axis=1)
    assert nearest.max() < 1e-6
    assert start[:, 0].max() < -0.1
    assert len(np.unique(start, axis=0)) == 6


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.3, 0.6)])
def test_a_push_slides_and_never_sinks(direction):
    controllers = find(along(direction))
    height = controllers.motion.mean(axis=1)[:, 2]
    assert height.min() > height[0] - 0.002
    assert abs(height[-1] - height[0]) < 0.004
    pixels, _ = camera().project(controllers.motion.mean(axis=1))
    np.testing.assert_allclose(pixels[-1] - pixels[0], np.array(direction) * 30, atol=1.5)


def test_without_a_ground_nothing_stops_a_fall():
    controllers = find(along((0.0, 1.0)), ground=None)
    assert controllers.motion[-1, :, 2].mean() < -0.05


def test_an_object_that_rests_elsewhere_is_stretched_as_little_as_the_image_allows():
    path = along((0.2, -1.0), 36.0)
    free, tethered = find(path).motion.mean(axis=1)[-1], find(path, resting_tracks()).motion.mean(axis=1)[-1]
    far = np.array([0.15, 0.0, 0.02])
    pixel, _ = camera().project(free[None])
    ray = camera().unproject(np.repeat(pixel, 200, axis=0), np.linspace(0.6, 1.2, 200))
    least = np.linalg.norm(ray - far, axis=1).min()
    assert np.linalg.norm(free - far) > least + 0.005
    assert np.linalg.norm(tethered - far) < least + 0.001
    np.testing.assert_allclose(camera().project(tethered[None])[0], pixel, atol=0.5)


def test_two_hands_are_two_grips():
    controllers = find(along((0.0, -1.0)), hands=("left", "right"))
    assert set(controllers.group.tolist()) == {0, 1}
    ends = [controllers.motion[0, controllers.group == group, 0].mean() for group in (0, 1)]
    assert abs(ends[0] - ends[1]) > 0.2


def test_lost_tracks_leave_the_masks_to_lead():
    path = along((0.0, -1.0))
    controllers = find(path, works=False)
    assert "followed by the masks alone" in controllers.warnings[0]
    pixels, _ = camera().project(controllers.motion.mean(axis=1))
    np.testing.assert_allclose(pixels[-1] - pixels[0], path[-1], atol=5.0)


def test_a_late_hand_holds_what_it_will_touch():
    path = np.concatenate([np.zeros((10, 2)), along((0.0, -1.0))[: COUNT - 10]])
    controllers = find(path, hand_from=6)
    assert "touches the object first on frame 6" in controllers.warnings[0]
    still = controllers.motion[:8]
    assert np.abs(still - still[0]).max() < 0.01
    assert controllers.motion[-1, :, 2].mean() > 0.05
    assert controllers.motion[0, :, 0].max() < -0.1


def test_no_hand_holds_nothing():
    controllers = find(along((0.0, -1.0)), hand_from=COUNT)
    assert controllers.motion.shape == (COUNT, 0, 3)
    assert controllers.group.shape == (0,)
    assert "nothing holds the object" in controllers.warnings[0]


def test_motion_starts_on_the_keyframe():
    path = along((0.0, -1.0))
    assert find(path, keyframe=5).motion.shape == (COUNT - 5, 6, 3)


@pytest.fixture
def clip():
    frames, masks = scene(along((0.0, -1.0)), keyframe=4)
    return frames, masks


def write(path, **arrays):
    np.savez(path, **arrays)
    return path


@pytest.mark.parametrize("name", ["controllers", "controls"])
@pytest.mark.parametrize("rows", [COUNT, COUNT - 4])
def test_given_motion_starts_on_the_keyframe(tmp_path, clip, name, rows):
    motion = np.random.default_rng(0).normal(size=(rows, 3, 3))
    found = read_controllers(write(tmp_path / "given.npz", **{name: motion}), *clip)
    np.testing.assert_allclose(found.motion, motion[rows - (COUNT - 4) :], atol=1e-6)
    assert found.group.shape == (3,)


def test_given_times_are_resampled(tmp_path, clip):
    times = np.array([0.0, 0.4, 2.0])
    motion = times[:, None, None] * np.array([1.0, 2.0, 3.0])
    found = read_controllers(write(tmp_path / "given.npz", controllers=motion, times=times), *clip)
    expected = clip[0].times[4:, None] * np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(found.motion[:, 0], expected, atol=1e-6)


@pytest.mark.parametrize("rows", [2 * COUNT + 1, 2 * COUNT - 7])
def test_given_motion_has_a_row_for_every_frame_of_a_thinned_clip(tmp_path, clip, rows):
    frames, masks = clip
    thinned = replace(frames, numbers=np.arange(0, 2 * COUNT, 2), clip_frames=2 * COUNT + 1)
    motion = np.random.default_rng(0).normal(size=(rows, 3, 3))
    found = read_controllers(write(tmp_path / "given.npz", controls=motion), thinned, masks)
    whole = motion[rows - (2 * COUNT - 7) :]
    np.testing.assert_allclose(found.motion, whole[:-1:2], atol=1e-6)


@pytest.mark.parametrize("clock", [lambda t: 1000 * t, lambda t: 1.7e9 + t, lambda t: t / 60])
def test_times_of_another_clock_are_refused(tmp_path, clip, clock):
    times = clock(clip[0].times)
    motion = np.zeros((COUNT, 1, 3))
    with pytest.raises(InputError, match=r"given.npz: times run .* expected seconds on the clip's clock"):
        read_controllers(write(tmp_path / "given.npz", controls=motion, times=times), *clip)


def test_a_motion_of_nobody_is_doubted(tmp_path, clip):
    found = read_controllers(write(tmp_path / "given.npz", controls=np.zeros((COUNT, 0, 3))), *clip)
    assert found.motion.shape == (COUNT - 4, 0, 3)
    assert found.warnings == ("given.npz holds no controller: the object will fall or rest",)


def test_a_motion_that_ends_long_before_the_clip_is_doubted(tmp_path, clip):
    motion, times = np.zeros((2, 1, 3)), np.array([0.0, clip[0].times[14]])
    found = read_controllers(write(tmp_path / "given.npz", controls=motion, times=times), *clip)
    assert found.warnings == (
        "given.npz says nothing of 47% of the clip's time: the hand stands still there",
    )


@pytest.mark.parametrize(
    ("arrays", "reason"),
    [
        ({"other": np.zeros(3)}, "controllers is missing"),
        ({"controllers": np.zeros((COUNT, 3))}, r"expected shape \[T, C, 3\], found \[24, 3\]"),
        ({"controllers": np.zeros((7, 1, 3))}, "expected 20 rows .* or 24 .all frames., found 7"),
        ({"controls": np.full((COUNT, 1, 3), np.nan)}, r"controls\[0\]: expected finite"),
        ({"controls": np.zeros((3, 1, 3)), "times": np.zeros(3)}, "strictly increasing"),
        ({"controls": np.zeros((3, 1, 3)), "times": np.zeros(2)}, r"times: expected shape \[3\]"),
    ],
)
def test_a_wrong_file_is_one_clear_line(tmp_path, clip, arrays, reason):
    with pytest.raises(InputError, match=reason) as caught:
        read_controllers(write(tmp_path / "given.npz", **arrays), *clip)
    assert "given.npz" in str(caught.value)
    assert "\n" not in str(caught.value)
