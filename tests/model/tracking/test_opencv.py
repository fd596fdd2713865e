import cv2
import numpy as np
import pytest

from model.errors import InputError
from model.tracking import OpenCVTracker, sample_queries
from model.types import Frames

SIZE = 160


def texture(seed, blur=2.0):
    noise = np.random.default_rng(seed).normal(size=(SIZE, SIZE)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), blur)
    return (127 + 40 * smooth / smooth.std()).clip(0, 255).astype(np.uint8)


def clip_of(images):
    colour = np.stack([np.repeat(image[..., None], 3, axis=2) for image in images])
    return Frames(colour, np.arange(len(images)) / 30.0, "made", "0" * 64)


def turning(count=13, key=6, angle=4.0, shift=(2.0, -1.5)):
    """A texture that turns and moves, and the map from the keyframe to each frame."""
    image, images, maps = texture(0), [], []
    for index in range(count):
        matrix = cv2.getRotationMatrix2D((80, 80), angle * (index - key), 1.0)
        matrix[:, 2] += np.array(shift) * (index - key)
        images.append(cv2.warpAffine(image, matrix, (SIZE, SIZE), borderMode=cv2.BORDER_REFLECT))
        maps.append(matrix)
    return clip_of(images), maps


def square(low, high):
    mask = np.zeros((SIZE, SIZE), bool)
    mask[low:high, low:high] = True
    return mask


def test_known_motion_is_followed_both_ways():
    frames, maps = turning()
    queries = sample_queries(square(55, 105), 60)
    tracks = OpenCVTracker()(frames, queries, 6)
    truth = np.stack([queries @ matrix[:, :2].T + matrix[:, 2] for matrix in maps])
    error = np.linalg.norm(tracks.points - truth, axis=-1)
    assert tracks.visible[[0, -1]].mean() > 0.9
    assert np.percentile(error[tracks.visible], 95) < 0.5
    np.testing.assert_array_equal(tracks.points[6], queries)
    assert tracks.visible[6].all()


def test_half_a_stripe_of_motion_does_not_make_stripes_jump():
    columns = np.arange(SIZE)[None, :] * np.ones((SIZE, 1))
    stripes = np.where(np.sin(columns * 2 * np.pi / 12) > 0, 60, 200)
    figure = 0.8 * stripes + 0.2 * texture(3, 6.0)
    images = [np.roll(figure, 3 * index, axis=1).astype(np.uint8) for index in range(10)]
    queries = sample_queries(square(50, 90), 40)
    tracks = OpenCVTracker()(clip_of(images), queries, 0)
    error = np.linalg.norm(tracks.points[-1] - queries - [27, 0], axis=-1)
    assert np.median(error) < 0.5
    assert (error[tracks.visible[-1]] < 2).mean() > 0.95


def test_a_covered_track_is_lost_where_it_was_last_seen():
    image, cover = texture(1), texture(2, 1.0)
    images = []
    for index in range(16):
        frame = image.copy()
        edge = 12 * index
        frame[:, :edge] = cover[:, :edge]
        images.append(frame)
    queries = np.array([[60.0, 80.0], [64.0, 84.0], [60.0, 90.0], [150.0, 80.0]], np.float32)
    tracks = OpenCVTracker()(clip_of(images), queries, 0)
    assert tracks.visible[3].all()
    assert not tracks.visible[-1, :3].any()
    assert np.linalg.norm(tracks.points[-1, :3] - queries[:3], axis=-1).max() < 8.0


def test_same_input_same_output_and_any_number_of_queries():
    frames, _ = turning(count=4, key=0)
    for count in (0, 1, 2, 5):
        queries = sample_queries(square(60, 100), 5)[:count]
        first, second = (OpenCVTracker()(frames, queries, 1) for _ in range(2))
        assert first.points.shape == (4, count, 2)
        np.testing.assert_array_equal(first.points, second.points)
        np.testing.assert_array_equal(first.visible, second.visible)


@pytest.mark.parametrize(
    ("query", "keyframe", "reason"),
    [
        ((5.0, 500.0), 0, "query 0 is not inside"),
        ((np.nan, 5.0), 0, "query 0"),
        ((5.0, 5.0), 9, "keyframe 9"),
    ],
)
def test_what_cannot_be_tracked_is_refused(query, keyframe, reason):
    frames, _ = turning(count=3, key=0)
    with pytest.raises(InputError, match=reason):
        OpenCVTracker()(frames, np.array([query], np.float32), keyframe)
