import numpy as np

from model.controllers.grip_motion import WINDOW, follow_back, follow_grip, smoothed
from model.types import Frames, Masks, Tracks

COUNT, HEIGHT, WIDTH = 30, 100, 160


def scene(path):
    """A fist right of the grip at (60, 50), the object left of it; both move by `path`."""
    hand, thing = np.zeros((2, COUNT, HEIGHT, WIDTH), bool)
    for index, (dx, dy) in enumerate(np.round(path).astype(int)):
        hand[index, 38 + dy : 62 + dy, 61 + dx : 85 + dx] = True
        thing[index, 42 + dy : 58 + dy, 20 + dx : 61 + dx] = True
    images = np.zeros((COUNT, HEIGHT, WIDTH, 3), np.uint8)
    return Frames(images, np.arange(COUNT) / 30.0, "made", ""), Masks(thing, hand, 0)


def turning(path, angle, spoiled=0.0):
    """A tracker that sees all turn about the grip; a share of its tracks is nonsense."""

    def track(frames, queries, keyframe):
        first = round(float(frames.times[0]) * 30)
        points = np.empty((len(frames.images), len(queries), 2))
        origin = np.array([60.0, 50.0])
        for index in range(len(points)):
            turn = angle[first + index] - angle[first + keyframe]
            matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
            local = queries - origin - path[first + keyframe]
            points[index] = local @ matrix.T + origin + path[first + index]
        wrong = np.arange(len(queries)) < spoiled * len(queries)
        points[1:, wrong] += np.random.default_rng(0).uniform(-30, 30, points[1:, wrong].shape)
        return Tracks(points.astype(np.float32), np.ones(points.shape[:2], bool))

    return track


def test_position_and_turn_are_found_in_spite_of_wrong_tracks():
    steps = np.linspace(0, 1, COUNT)
    path = np.stack([25 * steps, -20 * steps], axis=1)
    angle = -0.8 * steps
    frames, masks = scene(path)
    grip = follow_grip(frames, masks, 0, np.array([60.0, 50.0]), 20.0, turning(path, angle, spoiled=0.4))
    np.testing.assert_allclose(grip.position, path + np.array([60, 50]), atol=0.6)
    np.testing.assert_allclose(grip.angle, angle, atol=0.02)
    assert grip.tracked.all()
    assert grip.touching.all()
    np.testing.assert_array_equal(grip.position[0], [60, 50])


def test_tracks_are_renewed_and_a_grip_that_strays_returns_to_the_border():
    path = np.zeros((COUNT, 2))
    frames, masks = scene(path)
    astray = np.stack([np.zeros(COUNT), 1.5 * np.arange(COUNT)], axis=1)
    starts = []
    follow = turning(astray, np.zeros(COUNT))

    def spying(frames, queries, keyframe):
        starts.append(round(float(frames.times[0]) * 30))
        return follow(frames, queries, keyframe)

    grip = follow_grip(frames, masks, 0, np.array([60.0, 50.0]), 20.0, spying)
    assert starts == list(range(0, COUNT - 1, WINDOW))
    assert grip.position[:, 1].max() < 66
    assert grip.touching.all()


def test_what_comes_apart_is_said():
    path = np.zeros((COUNT, 2))
    frames, masks = scene(path)
    masks.hand[15:] = np.roll(masks.hand[15:], 40, axis=2)
    grip = follow_grip(frames, masks, 0, np.array([60.0, 50.0]), 20.0, turning(path, np.zeros(COUNT)))
    assert grip.touching[:15].all()
    assert not grip.touching[16:].any()


def test_back_to_the_keyframe_only_the_object_counts():
    steps = np.linspace(0, 1, COUNT)
    path = np.stack([0 * steps, -20 * steps], axis=1)
    frames, masks = scene(path)
    place = np.array([60.0, 50.0]) + path[20]
    grip = follow_back(frames, masks, 20, place, 20.0, turning(path, np.zeros(COUNT)))
    assert len(grip.position) == 21
    np.testing.assert_allclose(grip.position, path[:21] + np.array([60, 50]), atol=0.5)


def test_smoothing_removes_jitter_without_lag_and_keeps_the_start():
    time = np.linspace(0, 1, 40)[:, None]
    curve = np.concatenate([30 * time**2, 20 * time], axis=1)
    noisy = curve + np.random.default_rng(0).normal(0, 0.5, curve.shape)
    smooth = smoothed(noisy)
    np.testing.assert_allclose(smooth[0], noisy[0], atol=1e-12)
    assert np.std(smooth[9:] - curve[9:]) < 0.6 * np.std(noisy[9:] - curve[9:])
    np.testing.assert_allclose(smoothed(curve), curve, atol=1e-9)
    np.testing.assert_array_equal(smoothed(curve[:2]), curve[:2])
