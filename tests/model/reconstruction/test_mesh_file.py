import numpy as np
import pytest
import trimesh

from model.errors import InputError
from model.reconstruction.mesh_file import read_mesh


@pytest.fixture
def box():
    mesh = trimesh.creation.box((0.4, 0.2, 0.1))
    mesh.apply_translation([5.0, 6.0, 7.0])
    return mesh


@pytest.mark.parametrize("suffix", ["glb", "obj", "ply"])
def test_all_formats_give_the_same_centred_unit_surface(tmp_path, box, suffix):
    path = tmp_path / f"box.{suffix}"
    box.export(path)
    surface, digest = read_mesh(path)
    np.testing.assert_allclose(surface.points.max(0), [0.5, 0.25, 0.125], atol=2e-3)
    np.testing.assert_allclose(surface.points.min(0), [-0.5, -0.25, -0.125], atol=2e-3)
    assert np.all(np.einsum("ni,ni->n", surface.points, surface.normals) > 0)
    assert surface.colors is None
    assert len(digest) == 64


def test_inside_out_meshes_are_turned(tmp_path, box):
    box.invert()
    path = tmp_path / "box.ply"
    box.export(path)
    surface, _ = read_mesh(path)
    assert np.all(np.einsum("ni,ni->n", surface.points, surface.normals) > 0)


def test_colours_of_vertices_are_kept(tmp_path, box):
    left = box.vertices[:, 0] < 5.0
    box.visual.vertex_colors = np.where(left[:, None], [255, 0, 0, 255], [0, 0, 255, 255]).astype(np.uint8)
    path = tmp_path / "box.glb"
    box.export(path)
    surface, _ = read_mesh(path)
    assert surface.colors is not None
    ends = surface.points[:, 0] < -0.49, surface.points[:, 0] > 0.49
    np.testing.assert_allclose(surface.colors[ends[0]].mean(0), [1, 0, 0], atol=0.03)
    np.testing.assert_allclose(surface.colors[ends[1]].mean(0), [0, 0, 1], atol=0.03)


def test_colours_of_a_texture_are_kept(tmp_path):
    image = pytest.importorskip("PIL.Image", reason="trimesh reads textures with Pillow")
    picture = np.zeros((8, 8, 3), np.uint8)
    picture[:, :4], picture[:, 4:] = [250, 0, 0], [0, 0, 250]
    square = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=image.fromarray(picture))
    square.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    path = tmp_path / "square.glb"
    square.export(path)
    surface, _ = read_mesh(path)
    assert surface.colors is not None
    left = surface.points[:, 0] < -0.02
    np.testing.assert_allclose(surface.colors[left].mean(0) * 255, [250, 0, 0], atol=3)
    np.testing.assert_allclose(surface.colors[surface.points[:, 0] > 0.02].mean(0) * 255, [0, 0, 250], atol=3)


def refuse(path, said):
    with pytest.raises(InputError) as caught:
        read_mesh(path)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_no_mesh_is_refused_in_one_line(tmp_path):
    for name, content, said in [
        ("a.stl", b"solid", ".glb, .obj or .ply"),
        ("a.glb", b"", "not a readable GLB"),
        ("b.glb", b"glTF then something else entirely", "not a readable GLB"),
        ("a.ply", b"ply\nformat nonsense\n", "PLY"),
        ("a.obj", b"just words\n", "a.obj"),
    ]:
        path = tmp_path / name
        path.write_bytes(content)
        refuse(path, said)
    refuse(tmp_path / "none.glb", "cannot be read")


def test_points_without_faces_are_refused(tmp_path):
    path = tmp_path / "cloud.ply"
    trimesh.PointCloud(np.random.default_rng(0).normal(size=(50, 3))).export(path)
    refuse(path, "cloud.ply")


def test_vertices_that_are_not_finite_are_refused(tmp_path):
    path = tmp_path / "nan.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n")
    refuse(path, "finite")


def test_other_files_are_not_opened(tmp_path, box):
    secret = tmp_path / "secret.mtl"
    secret.write_text("newmtl red\nKd 1 0 0\n")
    path = tmp_path / "box.obj"
    corners = "vt 0 0\nvt 1 0\nvt 0 1\n"
    faces = "".join(f"f {a + 1}/1 {b + 1}/2 {c + 1}/3\n" for a, b, c in box.faces)
    places = "".join(f"v {x} {y} {z}\n" for x, y, z in box.vertices)
    path.write_text(f"mtllib secret.mtl\n{places}{corners}usemtl red\n{faces}")
    beside = trimesh.load(path)
    assert np.allclose(beside.visual.material.main_color, [255, 0, 0, 255]), "red, if it were read"
    surface, _ = read_mesh(path)
    assert surface.colors is None, "neither red nor the grey that stands for what was not read"
    assert surface.warnings == (
        "the colours of box.obj are in another file, which is not read: they are taken from the clip; "
        "a GLB holds its textures itself",
    )


@pytest.mark.parametrize(("factor", "expected"), [(None, None), ([255, 0, 0, 255], [1, 0, 0])])
def test_a_material_counts_where_it_names_a_colour(tmp_path, box, factor, expected):
    material = trimesh.visual.material.PBRMaterial(baseColorFactor=factor)
    box.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(box.vertices), 2)), material=material)
    path = tmp_path / "box.glb"
    box.export(path)
    surface, _ = read_mesh(path)
    assert surface.warnings == ()
    if expected is None:
        assert surface.colors is None
    else:
        np.testing.assert_allclose(surface.colors[0], expected, atol=0.01)
