import numpy as np
import pytest

from model.reconstruction.volume import (
    Volume,
    carved,
    distance_to_samples,
    grid_around,
    mask_distance,
    sample_image,
    without_specks,
)


def ball(radius=0.05, spacing=0.003):
    shape, origin, _ = grid_around(np.full(3, -radius), np.full(3, radius), np.eye(3), spacing)
    empty = Volume(np.zeros(shape, np.float32), origin, np.eye(3), spacing)
    distance = radius - np.linalg.norm(empty.points, axis=-1)
    return Volume(distance.astype(np.float32), origin, np.eye(3), spacing)


def test_the_volume_of_a_ball_is_that_of_the_formula():
    assert ball(0.05).total == pytest.approx(4 / 3 * np.pi * 0.05**3, rel=0.01)


def test_samples_and_gradients_follow_the_axes_of_the_grid():
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    plain = ball()
    volume = Volume(plain.distance, turned @ plain.origin, turned, plain.spacing)
    points = np.array([[0.03, 0.01, 0.0], [0.0, 0.045, 0.01]])
    np.testing.assert_allclose(volume.sample(points), 0.05 - np.linalg.norm(points, axis=1), atol=3e-4)
    inwards = -points / np.linalg.norm(points, axis=1, keepdims=True)
    np.testing.assert_allclose(volume.gradient(points), inwards, atol=0.03)


def test_beyond_the_grid_is_outside():
    assert ball().sample(np.array([[1.0, 0.0, 0.0]]))[0] < 0


def test_a_grid_keeps_to_its_budget_and_covers_its_box():
    shape, origin, spacing = grid_around(np.zeros(3), np.array([1.0, 0.5, 0.2]), np.eye(3), 1e-4)
    assert np.prod(shape) < 900_000
    assert np.all(origin < 0)
    assert np.all(origin + (np.array(shape) - 1) * spacing > [1.0, 0.5, 0.2])


def test_distance_to_samples_of_a_closed_surface_has_an_inside():
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(20_000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    truth = ball(0.05, 0.003)
    distance, enclosed = distance_to_samples(
        0.05 * normals, normals, truth.distance.shape, truth.origin, truth.spacing
    )
    assert enclosed
    volume = Volume(distance.astype(np.float32), truth.origin, np.eye(3), truth.spacing)
    assert volume.total == pytest.approx(truth.total, rel=0.02)


def test_surfaces_inside_a_body_bound_nothing():
    rng = np.random.default_rng(0)
    normals = rng.normal(size=(40_000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    radii = np.where(np.arange(40_000) < 25_000, 0.05, 0.025)[:, None]
    truth = ball(0.05, 0.003)
    distance, _ = distance_to_samples(
        radii * normals, normals, truth.distance.shape, truth.origin, truth.spacing
    )
    volume = Volume(distance.astype(np.float32), truth.origin, np.eye(3), truth.spacing)
    assert volume.total == pytest.approx(truth.total, rel=0.02)


def test_an_open_surface_encloses_nothing():
    flat = np.random.default_rng(0).uniform(-0.05, 0.05, (20_000, 3)) * [1, 1, 0]
    shape, origin, spacing = grid_around(np.full(3, -0.06), np.full(3, 0.06), np.eye(3), 0.003)
    distance, enclosed = distance_to_samples(flat, np.tile([0.0, 0, 1], (20_000, 1)), shape, origin, spacing)
    assert not enclosed
    assert distance.max() <= 0


def test_carving_keeps_what_projects_into_the_mask(scene_of):
    scene = scene_of([((0, 0, 0.05), (0.05, 0.05, 0.05))])
    left = scene.mask & (np.arange(scene.mask.shape[1]) < 100)
    plain = ball(0.05)
    body = Volume(plain.distance, plain.origin + np.array([0, 0, 0.05]), np.eye(3), plain.spacing)
    cut = carved(body, left, scene.camera)
    assert cut.total == pytest.approx(0.5 * body.total, rel=0.05)
    pixels, _ = scene.camera.project(cut.points[cut.distance > 0])
    assert pixels[:, 0].max() < 100.5


def test_mask_distance_is_zero_on_the_outline_and_the_border_counts():
    mask = np.zeros((20, 30), bool)
    mask[:, :10] = True
    distance = mask_distance(mask)
    np.testing.assert_allclose(distance[10, [0, 4, 9, 10, 12]], [0.5, 4.5, 0.5, -0.5, -2.5])


def test_images_are_sampled_between_pixels():
    image = np.arange(12, dtype=np.float64).reshape(3, 4)
    pixels = np.array([[0.5, 0.0], [1.0, 1.5], [-5.0, 0.0]])
    np.testing.assert_allclose(sample_image(image, pixels), [0.5, 7.0, 0.0])
    np.testing.assert_allclose(sample_image(image, pixels, -1.0), [0.5, 7.0, -1.0])


def test_specks_go_and_pieces_stay():
    plain = ball()
    distance = plain.distance.copy()
    distance[:2, :2, :2] = 0.001
    speckled = Volume(distance, plain.origin, plain.axes, plain.spacing)
    assert without_specks(speckled).distance[0, 0, 0] < 0
    np.testing.assert_array_equal(without_specks(plain).distance, plain.distance)
    halves = plain.distance.copy()
    halves[halves.shape[0] // 2] = -0.001
    both = Volume(halves, plain.origin, plain.axes, plain.spacing)
    assert without_specks(both).total == both.total
