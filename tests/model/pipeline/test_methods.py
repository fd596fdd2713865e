import pytest

from model.errors import InputError
from model.pipeline.methods import choose
from model.pipeline.options import TwinOptions


def test_what_comes_without_a_wish():
    methods = choose(TwinOptions())
    assert (methods.segmenter.name, methods.tracker.name, methods.encoder.name) == (
        "classical",
        "opencv",
        "texture",
    )
    assert (methods.prior.name, methods.predictor.name) == ("stub", "matphys")


@pytest.fixture
def mesh(tmp_path):
    """A tetrahedron."""
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    return path


def test_the_reconstruction_is_what_the_given_files_are_for(mesh):
    named = {
        "silhouette": TwinOptions(),
        "mesh": TwinOptions(mesh=mesh),
        "depth": TwinOptions(depth=mesh.with_name("depth.png")),
    }
    for name, options in named.items():
        assert choose(options).reconstructor.name == name


@pytest.mark.parametrize("name", ["silhouette", "depth"])
def test_a_mesh_that_would_not_be_used_is_refused(mesh, name):
    both = TwinOptions(mesh=mesh, depth=mesh.with_name("depth.png"), reconstruction=name)
    with pytest.raises(InputError, match=f"--reconstruction {name} has no use for --mesh"):
        choose(both)


@pytest.mark.parametrize(
    ("wish", "expected"),
    [
        ({"segmentation": "magic"}, "unknown segmentation method 'magic': choose one of classical, sam2"),
        ({"tracking": "magic"}, "unknown tracking method"),
        ({"reconstruction": "magic"}, "unknown reconstruction method"),
        ({"encoder": "magic"}, "unknown encoder method"),
        ({"prior": "magic"}, "unknown prior method"),
        ({"predictor": "magic"}, "--predictor magic: choose matphys, prior-mean, or a .safetensors file"),
        ({"renderer": "magic"}, "unknown renderer method"),
        ({"reconstruction": "mesh"}, "needs --mesh PATH"),
    ],
)
def test_a_wrong_name_is_told(wish, expected):
    with pytest.raises(InputError, match=expected):
        choose(TwinOptions(**wish))
