import numpy as np
import pygltflib
import pytest
import trimesh

from model.exports.glb import GlbExporter
from model.exports.mechanics import roll


@pytest.fixture
def read(rope, tmp_path):
    GlbExporter()(rope, tmp_path / "rope.glb")
    return pygltflib.GLTF2().load(str(tmp_path / "rope.glb"))


def numbers(file, index):
    accessor = file.accessors[index]
    view, width = file.bufferViews[accessor.bufferView], {"SCALAR": 1, "VEC3": 3}[accessor.type]
    kind = {5126: "<f4", 5125: "<u4"}[accessor.componentType]
    start = view.byteOffset
    values = np.frombuffer(file.binary_blob()[start : start + view.byteLength], kind)
    assert len(values) == width * accessor.count
    return values.reshape(accessor.count, width).squeeze()


def test_another_reader_plays_the_points_where_the_twin_has_them(read, rope):
    (primitive,), trajectory = read.meshes[0].primitives, roll(rope)
    sampler = read.animations[0].samplers[0]
    times, weights = numbers(read, sampler.input), numbers(read, sampler.output)
    np.testing.assert_allclose(times, trajectory.times, atol=1e-6)
    weights = weights.reshape(len(times), len(primitive.targets))
    base = numbers(read, primitive.attributes.POSITION)
    targets = np.stack([numbers(read, target["POSITION"]) for target in primitive.targets])
    points = len(rope.topology.points)
    for frame in (0, 7, len(times) - 1):
        places = base + np.tensordot(weights[frame], targets, 1)
        middle = places.reshape(-1, 6, 3).mean(axis=1)
        np.testing.assert_allclose(middle[:points], trajectory.points[frame], atol=1e-6)
        np.testing.assert_allclose(middle[points:], rope.controls[frame], atol=1e-6)


def test_at_most_two_targets_have_a_weight_at_any_moment(read):
    sampler = read.animations[0].samplers[0]
    targets = len(read.meshes[0].primitives[0].targets)
    weights = numbers(read, sampler.output).reshape(-1, targets)
    halfway = 0.5 * (weights[1:] + weights[:-1])
    assert (np.count_nonzero(halfway, axis=1) <= 2).all()


def test_it_stands_upright_and_is_closed(rope, tmp_path):
    """trimesh reads y up, where the twin has z up; its bodies have outward faces."""
    GlbExporter()(rope, tmp_path / "rope.glb")
    mesh = trimesh.load(tmp_path / "rope.glb").to_geometry()
    points = np.concatenate([rope.topology.points, rope.controls[0]])
    extent = np.stack([points.min(axis=0), points.max(axis=0)])
    np.testing.assert_allclose(mesh.bounds[:, 1], extent[:, 2], atol=0.02)
    np.testing.assert_allclose(mesh.bounds[:, 0], extent[:, 0], atol=0.02)
    assert mesh.volume > 0


def test_its_readme_travels_inside(read):
    text = read.asset.extras["readme"]
    assert "y up" in text
    assert "cannot express" in text
