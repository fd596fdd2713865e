import json

from click.testing import CliRunner

from model.commands.scenes import KINDS, scenes
from model.scenes.files import load_folder
from model.scenes.world.shapes import CLASSES


def run(*arguments):
    return CliRunner().invoke(scenes, [str(one) for one in arguments])


def test_the_command_writes_a_folder_of_cases_and_says_so(tmp_path):
    result = run(tmp_path / "new", "--count", 1, "--class", "cloth", "--workers", 1, "--seed", 3)
    assert result.exit_code == 0, result.output
    cases = load_folder(tmp_path / "new")
    assert len(cases) >= 3
    assert {case.object_class for case in cases} == {"cloth"}
    assert f"wrote {len(cases)} cases of 1 objects to {tmp_path / 'new'}" in result.stdout


def test_json_is_the_index_and_nothing_else(tmp_path):
    result = run(tmp_path, "--count", 1, "--class", "cloth", "--workers", 1, "--json")
    found = json.loads(result.stdout)
    assert found == json.loads((tmp_path / "index.json").read_text())
    assert found["seed"] == 0


def test_classes_on_offer_are_those_there_are():
    assert KINDS == CLASSES


def test_bad_options_are_refused(tmp_path):
    assert run(tmp_path, "--count", 0).exit_code == 2
    assert run(tmp_path, "--class", "cat").exit_code == 2


def test_recordings_are_taken_instead_of_made(tmp_path, save_phystwin):
    recording = save_phystwin(tmp_path, "double_lift_cloth_1")
    result = run(tmp_path / "cases", "--phystwin", recording)
    assert result.exit_code == 0, result.output
    assert f"wrote 1 cases of 1 objects to {tmp_path / 'cases'}" in result.stdout
    assert [case.name for case in load_folder(tmp_path / "cases")] == ["double_lift_cloth_1"]
    result = run(tmp_path / "more", "--phystwin", recording, "--count", 3)
    assert result.exit_code == 2
    assert "--count is of objects that are made" in result.output
    assert not (tmp_path / "more").exists()
