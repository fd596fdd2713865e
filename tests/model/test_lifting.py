"""Which Gaussians are seen, and where the features of the others come from."""

import numpy as np
import pytest

from model.errors import InputError
from model.lifting import lift_features, visible_gaussians
from model.types import Camera, Features, Gaussians

SPACING = 0.01
CAMERA = Camera(
    intrinsics=np.array([[400.0, 0, 159.5], [0, 400.0, 119.5], [0, 0, 1]]),
    world_from_camera=np.array([[1.0, 0, 0, 0], [0, 0, 1, -1], [0, -1, 0, 0], [0, 0, 0, 1]]),
    width=320,
    height=240,
)
"""At (0, -1, 0), looking along +y; x is right, z is up."""
EVERYWHERE = np.ones((240, 320), bool)


def gaussians(points, scale=0.5 * SPACING):
    count = len(points)
    return Gaussians(
        means=np.asarray(points, np.float32),
        scales=np.full((count, 3), scale, np.float32),
        quaternions=np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
        opacities=np.full(count, 0.9, np.float32),
        colors=np.full((count, 3), 0.5, np.float32),
        volumes=np.full(count, SPACING**3, np.float32),
    )


def ball(radius=0.1, centre=(0.0, 0.0, 0.0), spacing=SPACING):
    axis = np.arange(-radius, radius + 1e-9, spacing)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    points = points + np.random.default_rng(0).uniform(-0.3, 0.3, points.shape) * spacing
    return points[np.linalg.norm(points, axis=1) < radius] + centre


def wall(y=0.0, half=0.1, centre=(0.0, 0.0)):
    axis = np.arange(-half, half + 1e-9, SPACING)
    x, z = np.meshgrid(axis, axis)
    return np.stack([x.ravel() + centre[0], np.full(x.size, y), z.ravel() + centre[1]], axis=1)


def map_of(function, rows=60, columns=80):
    """A feature map whose cells hold a function of their pixel position."""
    y, x = np.meshgrid((np.arange(rows) + 0.5) * 4 - 0.5, (np.arange(columns) + 0.5) * 4 - 0.5, indexing="ij")
    return np.stack(function(x, y), axis=-1).astype(np.float32)


def half_split(x, y):
    return np.where(x < 159.5, 1.0, -1.0), 0.1 * y / 240, np.ones_like(x)


def test_the_front_of_a_ball_is_seen_and_its_back_and_inside_are_not():
    points = ball()
    seen = visible_gaussians(gaussians(points), CAMERA, EVERYWHERE)
    radius = np.linalg.norm(points, axis=1)
    towards = -points[:, 1] / np.maximum(radius, 1e-9)
    front = (radius > 0.09) & (towards > 0.6)
    assert seen[front].mean() > 0.9
    assert not seen[points[:, 1] > 0.03].any()
    assert not seen[radius < 0.06].any()


def test_a_wall_hides_what_stands_behind_it():
    front, back = wall(0.0), wall(0.2, half=0.08)
    seen = visible_gaussians(gaussians(np.concatenate([front, back])), CAMERA, EVERYWHERE)
    assert seen[: len(front)].all()
    assert not seen[len(front) :].any()


def test_what_stands_beside_the_wall_is_seen_however_far_behind():
    front, back = wall(0.0), wall(0.3, centre=(0.25, 0.0))
    seen = visible_gaussians(gaussians(np.concatenate([front, back])), CAMERA, EVERYWHERE)
    assert seen[len(front) :].all()


def test_a_leaning_sheet_is_seen_as_a_whole():
    points = wall(0.0)
    points[:, 1] = 1.2 * points[:, 0]  # 50 degrees
    assert visible_gaussians(gaussians(points), CAMERA, EVERYWHERE).mean() > 0.95


@pytest.mark.parametrize("scale", [0.05 * SPACING, 0.5 * SPACING, 0.9 * SPACING])
def test_small_gaussians_still_close_the_surface(scale):
    front, back = wall(0.0), wall(0.2, half=0.08)
    seen = visible_gaussians(gaussians(np.concatenate([front, back]), scale), CAMERA, EVERYWHERE)
    assert seen[: len(front)].all()
    assert not seen[len(front) :].any()


def test_outside_the_mask_nothing_is_seen():
    mask = EVERYWHERE.copy()
    mask[:, 160:] = False
    points = wall()
    seen = visible_gaussians(gaussians(points), CAMERA, mask)
    np.testing.assert_array_equal(seen, points[:, 0] < 0.001)


def test_behind_the_camera_and_outside_the_image_nothing_is_seen():
    points = np.concatenate([wall(-2.0), wall(0.0, centre=(5.0, 0.0))])
    assert not visible_gaussians(gaussians(points), CAMERA, EVERYWHERE).any()


def test_what_is_close_by_is_tested_at_a_lower_resolution_with_the_same_answer():
    front, back = wall(-0.9, half=0.03), wall(-0.85, half=0.02, centre=(0.0075, 0.0075))
    seen = visible_gaussians(gaussians(np.concatenate([front, back])), CAMERA, EVERYWHERE)
    assert not seen[len(front) :].any()
    assert seen[: len(front)].any()


def test_a_mask_of_another_size_is_refused():
    with pytest.raises(InputError, match="10x20 but the camera's image is 320x240"):
        visible_gaussians(gaussians(wall()), CAMERA, np.ones((20, 10), bool))


def test_an_object_outside_its_mask_is_refused():
    with pytest.raises(InputError, match="seen inside its mask"):
        lift_features(map_of(half_split), gaussians(wall()), CAMERA, ~EVERYWHERE)


def test_seen_gaussians_sample_the_map_where_they_project():
    """A linear function of the pixel comes back, up to the rotation of the principal axes."""
    shape = gaussians(wall())
    features = lift_features(map_of(lambda x, y: (x / 10, y / 10)), shape, CAMERA, EVERYWHERE)
    pixels, _ = CAMERA.project(shape.means)
    assert (features.origin == Features.SEEN).all()
    centred = pixels / 10 - (pixels / 10).mean(axis=0)
    np.testing.assert_allclose(
        np.linalg.norm(features.values, axis=1), np.linalg.norm(centred, axis=1), atol=1e-3
    )


def test_samples_are_taken_at_the_very_pixel():
    """A parabola around the middle of the image stays centred there: half a cell off, it would lean."""
    shape = gaussians(wall())
    features = lift_features(map_of(lambda x, y: (((x - 159.5) / 10) ** 2,)), shape, CAMERA, EVERYWHERE)
    pixels, _ = CAMERA.project(shape.means)
    expected = ((pixels[:, 0] - 159.5) / 10) ** 2
    np.testing.assert_allclose(features.values[:, 0], expected - expected.mean(), atol=0.06)


def test_the_background_does_not_bleed_in():
    mask = np.zeros((240, 320), bool)
    mask[88:152, 128:192] = True
    field = map_of(lambda x, y: (np.where((x > 128) & (x < 192) & (y > 88) & (y < 152), 1.0, 100.0), y * 0))
    shape = gaussians(wall(half=0.079))
    features = lift_features(field, shape, CAMERA, mask)
    seen = features.origin == Features.SEEN
    assert np.ptp(features.values[seen], axis=0).max() < 1.0


def test_the_back_takes_its_mirror_image_where_that_was_seen():
    """Thin enough that front and back mirror at the mid-surface; left and right differ."""
    points = np.concatenate([wall(y) for y in (0.0, 0.02, 0.04)])
    features = lift_features(map_of(half_split), gaussians(points), CAMERA, EVERYWHERE)
    back = slice(2 * len(points) // 3, None)
    assert (features.origin[back] == Features.SYMMETRY).mean() > 0.9
    front_values = features.values[: len(points) // 3]
    np.testing.assert_allclose(features.values[back], front_values, atol=0.3)


def test_what_has_no_seen_counterpart_takes_its_neighbours():
    points = ball()
    features = lift_features(map_of(half_split), gaussians(points), CAMERA, EVERYWHERE)
    inside = np.linalg.norm(points, axis=1) < 0.04
    assert (features.origin[inside] == Features.NEIGHBOURHOOD).all()
    clear = inside & (np.abs(points[:, 0]) > 0.025)
    assert (np.sign(features.values[clear, 0]) == np.sign(points[clear, 0])).mean() in (0.0, 1.0)


def test_a_lopsided_object_has_no_symmetry_to_use():
    """Three balls would have one: the plane through their centres."""
    centres = np.random.default_rng(5).uniform(-0.15, 0.15, (6, 3))
    points = np.concatenate([ball(0.04, centre) for centre in centres])
    features = lift_features(map_of(half_split), gaussians(points), CAMERA, EVERYWHERE)
    assert (features.origin != Features.SYMMETRY).all()
    assert (features.origin == Features.NEIGHBOURHOOD).any()


def test_dimensions_are_at_most_32_and_signs_fixed():
    rng = np.random.default_rng(0)
    wide = rng.standard_normal((60, 80, 50)).astype(np.float32)
    first = lift_features(wide, gaussians(wall()), CAMERA, EVERYWHERE)
    assert first.values.shape[1] == 32
    second = lift_features(wide.copy(), gaussians(wall()), CAMERA, EVERYWHERE)
    assert first.values.tobytes() == second.values.tobytes()
    assert lift_features(wide[..., :7], gaussians(wall()), CAMERA, EVERYWHERE).values.shape[1] == 7


def test_components_come_in_order_of_variance():
    rng = np.random.default_rng(0)
    field = rng.standard_normal((60, 80, 6)).astype(np.float32) * np.float32([1, 5, 0.2, 3, 0.5, 2])
    variance = lift_features(field, gaussians(wall()), CAMERA, EVERYWHERE).values.var(axis=0)
    assert (np.diff(variance) <= 0).all()


@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_handful_of_gaussians_is_enough(count):
    points = np.stack([np.linspace(0, 0.02, count), np.zeros(count), np.zeros(count)], axis=1)
    features = lift_features(map_of(half_split), gaussians(points), CAMERA, EVERYWHERE)
    assert len(features.values) == count
    assert np.isfinite(features.values).all()


def test_a_mask_that_shows_next_to_nothing_is_worth_a_warning():
    mask = np.zeros((240, 320), bool)
    mask[119:123, 158:162] = True
    features = lift_features(map_of(half_split), gaussians(ball()), CAMERA, mask)
    assert "are seen" in features.warnings[0]
    assert lift_features(map_of(half_split), gaussians(ball()), CAMERA, EVERYWHERE).warnings == ()
