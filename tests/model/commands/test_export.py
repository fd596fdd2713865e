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
