import json

import pytest


@pytest.fixture
def export(run):
    return lambda twin, *options: run("export", twin, *options)


def test_one_file(export, twin_path):
    out = twin_path.parent / "gaussians.ply"
    done = export(twin_path, "--to", "ply", "--out", out)
    assert (done.code, done.stdout, done.stderr) == (0, f"wrote {out}\n", "")
    assert out.read_bytes().startswith(b"ply\n")


def test_what_was_written_as_json(export, twin_path):
    out = twin_path.parent / "gaussians.ply"
    result = json.loads(export(twin_path, "--to", "ply", "--out", out, "--json").stdout)
    assert result == {"format": "ply", "files": [str(out)]}


def test_an_unknown_format(export, twin_path):
    done = export(twin_path, "--to", "abc", "--out", twin_path.parent / "o")
    assert done.code == 2
    assert "unknown export method 'abc': choose one of" in done.line


def test_the_twin_is_never_overwritten(export, twin_path):
    done = export(twin_path, "--to", "ply", "--out", twin_path)
    assert done.code == 2
    assert "is the input" in done.line


def test_a_smaller_twin_is_exported_and_its_deviation_printed(export, twin_path, tmp_path):
    result = export(twin_path, "--to", "mujoco", "--out", tmp_path / "out", "--points", 14)
    assert result.code == 0, result.stderr
    assert result.stdout.startswith("coarsened to 14 points")
    assert " mm at most" in result.stdout
    assert (tmp_path / "out" / "twin.xml").read_text().count('<body name="point') == 14
    assert "coarsened to 14 points" in (tmp_path / "out" / "README.md").read_text()


def test_the_deviation_as_json(export, twin_path, tmp_path):
    result = export(twin_path, "--to", "newton", "--out", tmp_path / "out", "--points", 14, "--json")
    told = json.loads(result.stdout)
    assert told["coarsening"]["points"] == 14
    assert 0 < told["coarsening"]["mean_m"] <= told["coarsening"]["max_m"] < 0.1


def test_frames_of_ply(export, twin_path, tmp_path):
    result = export(twin_path, "--to", "ply", "--out", tmp_path / "out", "--frames")
    assert result.code == 0, result.stderr
    assert len(list((tmp_path / "out").glob("frame_*.ply"))) == 5


def test_too_many_points_are_refused(export, twin_path, tmp_path):
    done = export(twin_path, "--to", "mujoco", "--out", tmp_path / "o", "--points", 99)
    assert done.code == 2
    assert done.line == "matphys: --points 99: this twin has 27 points, give 8 to 26"


def test_points_of_a_ply_at_rest_are_refused(export, twin_path, tmp_path):
    done = export(twin_path, "--to", "ply", "--out", tmp_path / "o.ply", "--points", 14)
    assert done.code == 2
    assert done.line == (
        "matphys: --points: a PLY at rest has none of the mass points: add --frames, or leave it out"
    )
    assert not (tmp_path / "o.ply").exists()


@pytest.mark.parametrize("target", ["mujoco", "newton"])
def test_the_readme_of_something_else_is_left_alone(export, twin_path, tmp_path, target):
    """That of an export is not: the second one takes its place."""
    out = tmp_path / "out"
    assert [export(twin_path, "--to", target, "--out", out).code for _ in range(2)] == [0, 0]
    (out / "README.md").write_text("# My project")
    (out / "twin.xml").unlink(missing_ok=True)
    done = export(twin_path, "--to", target, "--out", out)
    assert done.code == 2
    assert done.line.endswith("README.md: it is of no export: give the name of another folder")
    assert (out / "README.md").read_text() == "# My project"
    assert not (out / "twin.xml").exists()


def test_files_of_something_else_are_left_alone(export, twin_path, tmp_path):
    out = tmp_path / "mine"
    out.mkdir()
    (out / "run.py").write_text("my work")
    done = export(twin_path, "--to", "newton", "--out", out)
    assert done.code == 2
    assert done.line.endswith("run.py: it is of no export: give the name of another folder")
    assert [path.name for path in out.iterdir()] == ["run.py"]
    assert (out / "run.py").read_text() == "my work"


def test_frames_of_a_longer_export_go_and_other_files_stay(export, write_twin, tensors, tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    for name in ("frame_0009.ply", "frame_0009.ply.bak"):
        (out / name).touch()
    frames = ("--to", "ply", "--out", out, "--frames")
    assert export(write_twin(), *frames).code == 0
    assert (out / "frame_0009.ply").exists()  # it was there before any export
    assert export(write_twin(controls=tensors["controls"][:3]), *frames).code == 0
    left = sorted(path.name for path in out.iterdir())
    assert left == ["README.md", *(f"frame_000{n}.ply" for n in range(3)), "frame_0009.ply.bak"]
