from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from model.reconstruction.alignment import Placement, align
from model.reconstruction.mesh import MeshReconstructor, volume_of
from model.reconstruction.mesh_file import read_mesh
from model.reconstruction.outline import overlap, silhouette_of
from model.reconstruction.scale import sized
from model.types import Frames, Masks


def part(radius, center, color):
    mesh = trimesh.creation.icosphere(3, radius)
    mesh.apply_translation(center)
    mesh.visual.vertex_colors = np.array([*color, 255], np.uint8)
    return mesh


@pytest.fixture(scope="module")
def figure():
    """A y-up figure with a pale face, of overlapping balls, no side like another."""
    return trimesh.util.concatenate(
        [
            part(0.10, [0, 0, 0], [150, 100, 50]),
            part(0.07, [0, 0.14, 0], [160, 110, 60]),
            part(0.035, [0.12, 0.05, 0.02], [200, 120, 70]),
            part(0.045, [-0.06, -0.11, 0.02], [40, 90, 140]),
            part(0.03, [0, 0.15, 0.06], [250, 240, 230]),
        ]
    )


@pytest.fixture(scope="module")
def lying(figure, tmp_path_factory, scene_of):
    """The figure on its back on a table at a heading of 40°: its file, the clip, and true surface points."""
    path = tmp_path_factory.mktemp("mesh") / "figure.glb"
    figure.export(path)
    scene = scene_of([((0, 0, 0.05), (0.05, 0.05, 0.05))])
    points, faces = trimesh.sample.sample_surface(figure, 40_000, seed=1)
    colors = figure.visual.vertex_colors[figure.faces[faces][:, 0], :3]
    world = 0.7 * Rotation.from_euler("z", 40, degrees=True).apply(points)  # face (+z) up
    world[:, 2] -= world[:, 2].min()
    pixels, depth = scene.camera.project(world)
    corner = np.round(pixels).astype(int)
    image = np.full(scene.image.shape, 205, np.uint8)
    mask = np.zeros(scene.mask.shape, bool)
    for index in np.argsort(-depth):
        image[corner[index, 1], corner[index, 0]] = colors[index]
    mask[corner[:, 1], corner[:, 0]] = True
    frames = Frames(np.stack([image, image]), np.array([0, 0.1]), "figure", "0" * 64)
    masks = Masks(np.stack([mask, mask]), np.zeros((2, *mask.shape), bool), 0)
    return path, frames, masks, scene.calibration(), world


@pytest.fixture(scope="module")
def body(lying):
    path, frames, masks, calibration, _ = lying
    return MeshReconstructor(path)(frames, masks, calibration, "solid")


def test_a_mesh_is_found_again_where_it_lay(lying, figure):
    path, frames, masks, calibration, world = lying
    surface, _ = read_mesh(path)
    placement = align(surface, frames.images[0], masks.object[0], calibration)
    gap = np.linalg.norm(np.median(placement.apply(surface.points), 0) - np.median(world, 0))
    assert gap < 0.006
    assert placement.scale == pytest.approx(0.7 * np.ptp(figure.bounds, axis=0).max(), rel=0.05)
    face = surface.points[surface.colors.mean(1) > 0.9].mean(0)
    true_face = 0.7 * Rotation.from_euler("z", 40, degrees=True).apply([0, 0.15, 0.06])
    found = placement.apply(face[None])[0]
    assert np.linalg.norm(found[:2] - true_face[:2]) < 0.012
    assert found[2] > 0.07  # the face is up


@pytest.mark.parametrize("shift", [(0.0, 1.0, -1.0), (0.0, 2.0, 0.0), (3.0, 4.0, 0.0)])
def test_wherever_the_worlds_origin_is(lying, shift):
    """A camera file says: it may be at the camera, behind it or far off."""
    path, frames, masks, calibration, _ = lying
    surface, _ = read_mesh(path)
    here = align(surface, frames.images[0], masks.object[0], calibration)
    pose = calibration.camera.world_from_camera.copy()
    pose[:3, 3] += shift
    moved = replace(
        calibration, camera=replace(calibration.camera, world_from_camera=pose), ground_height=shift[2]
    )
    there = align(surface, frames.images[0], masks.object[0], moved)
    assert there.scale == pytest.approx(here.scale, rel=1e-3)
    np.testing.assert_allclose(there.apply(surface.points), here.apply(surface.points) + shift, atol=1e-3)


def test_the_body_fills_the_mask_with_the_colours_of_the_mesh(lying, body):
    gaussians = body
    _, _, masks, calibration, world = lying
    assert overlap(silhouette_of(gaussians, calibration.camera), masks.object[0]) > 0.88
    assert 6_000 <= len(gaussians) <= 12_000
    assert gaussians.warnings == ()
    assert gaussians.means[:, 2].min() > 0
    np.testing.assert_allclose(np.ptp(gaussians.means, 0), np.ptp(world, 0), atol=0.02)
    blue = gaussians.colors[:, 2] > gaussians.colors[:, 0] + 0.1
    assert 0.01 < blue.mean() < 0.2


def test_a_closed_mesh_has_its_volume_and_an_open_one_is_a_shell(tmp_path):
    unit = Placement(np.eye(3), 0.3, np.zeros(3))
    box = trimesh.creation.box((1.0, 0.5, 0.25))
    box.export(tmp_path / "box.ply")
    body = volume_of(read_mesh(tmp_path / "box.ply")[0], unit)
    assert body.total == pytest.approx(0.3**3 * 0.125, rel=0.04)
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    sheet.export(tmp_path / "sheet.ply")
    shell = volume_of(read_mesh(tmp_path / "sheet.ply")[0], unit)
    assert 0.3**2 * 0.0015 < shell.total < 0.3**2 * 0.006


def test_overlapping_parts_count_once(figure, tmp_path):
    figure.export(tmp_path / "figure.ply")
    surface, _ = read_mesh(tmp_path / "figure.ply")
    body = volume_of(surface, Placement(np.eye(3), 0.32, np.zeros(3)))
    rng = np.random.default_rng(0)
    low, high = figure.bounds
    points = rng.uniform(low, high, (100_000, 3))
    balls = [(0.10, [0, 0, 0]), (0.07, [0, 0.14, 0]), (0.035, [0.12, 0.05, 0.02])]
    balls += [(0.045, [-0.06, -0.11, 0.02]), (0.03, [0, 0.15, 0.06])]
    inside = np.any([np.linalg.norm(points - c, axis=1) < r for r, c in balls], axis=0)
    scale = 0.32 / float((high - low).max())
    assert body.total == pytest.approx(inside.mean() * np.prod(high - low) * scale**3, rel=0.04)


def test_a_stated_size_is_the_longest_side_of_the_mesh(lying, body):
    path, frames, masks, calibration, _ = lying
    method = MeshReconstructor(path)

    def side(world):
        return method.extent(frames, masks, world, "solid")

    stated = sized(masks, calibration, 0.5, "stated", side)
    assert side(stated) == pytest.approx(0.5, rel=0.01)
    gaussians = method(frames, masks, stated, "solid")
    grown = 0.5 / side(calibration)
    assert np.ptp(gaussians.means, 0) == pytest.approx(grown * np.ptp(body.means, 0), rel=0.03)
    assert overlap(silhouette_of(gaussians, stated.camera), masks.object[0]) > 0.88


def test_a_mesh_of_something_else_is_doubted(lying, tmp_path):
    _, frames, masks, calibration, _ = lying
    rod = trimesh.creation.box((1.0, 0.03, 0.03))
    rod.export(tmp_path / "rod.ply")
    gaussians = MeshReconstructor(tmp_path / "rod.ply")(frames, masks, calibration, "solid")
    assert any("rod.ply" in warning for warning in gaussians.warnings)


def test_the_same_mesh_and_clip_give_the_same_bytes(lying, body):
    path, frames, masks, calibration, _ = lying
    again = MeshReconstructor(path)(frames, masks, calibration, "solid")
    assert again.means.tobytes() == body.means.tobytes()
    assert again.colors.tobytes() == body.colors.tobytes()
