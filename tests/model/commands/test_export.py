import json

from click.testing import CliRunner

from model.cli import main, matphys


def run(*arguments):
    return CliRunner().invoke(matphys, ["export", *map(str, arguments)])


def test_a_smaller_twin_is_exported_and_its_deviation_printed(twin_path, tmp_path):
    result = run(twin_path, "--to", "mujoco", "--out", tmp_path / "out", "--points", 14)
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("coarsened to 14 points")
    assert " mm at most" in result.stdout
    assert (tmp_path / "out" / "twin.xml").read_text().count('<body name="point') == 14
    assert "coarsened to 14 points" in (tmp_path / "out" / "README.md").read_text()


def test_the_deviation_as_json(twin_path, tmp_path):
    result = run(twin_path, "--to", "newton", "--out", tmp_path / "out", "--points", 14, "--json")
    told = json.loads(result.stdout)
    assert told["coarsening"]["points"] == 14
    assert 0 < told["coarsening"]["mean_m"] <= told["coarsening"]["max_m"] < 0.1


def test_frames_of_ply(twin_path, tmp_path):
    result = run(twin_path, "--to", "ply", "--out", tmp_path / "out", "--frames")
    assert result.exit_code == 0, result.output
    assert len(list((tmp_path / "out").glob("frame_*.ply"))) == 5


def test_too_many_points_are_refused(twin_path, tmp_path, capsys):
    code = main(["export", str(twin_path), "--to", "mujoco", "--out", str(tmp_path / "o"), "--points", "99"])
    assert code == 2
    assert capsys.readouterr().err == "matphys: --points 99: this twin has 27 points, give 8 to 26\n"
