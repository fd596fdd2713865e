import json
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from model.commands.evaluate import evaluate
from model.errors import InputError
from model.scenes.files import save_case, write_index


@pytest.fixture(scope="module")
def folder(make_case, tmp_path_factory):
    path = tmp_path_factory.mktemp("cases")
    for interaction, lift in (("lift", 0.25), ("push", 0.12)):
        case = replace(make_case(frames=10, lift=lift), name=f"bar-{interaction}", interaction=interaction)
        save_case(case, path / f"{case.name}.case.npz")
    write_index(path)
    return path


def run(folder, out, *options):
    arguments = [str(folder), "--out", str(out), "--workers", "1", *options]
    return CliRunner().invoke(evaluate, arguments, catch_exceptions=False)


def test_the_tables_are_printed_and_written(folder, tmp_path):
    done = run(folder, tmp_path / "out", "--methods", "prior_mean,hold-last", "--priors", "right")
    assert done.exit_code == 0
    assert "### Future (7:3 in time)" in done.stdout
    assert "| prior-mean |" in done.stdout
    assert "Worse than prior-mean by" in done.stdout
    text = (tmp_path / "out" / "tables.md").read_text()
    assert (
        f"matphys evaluate {folder} --methods prior_mean,hold-last --out {tmp_path / 'out'} --priors right"
        in text
    )
    assert "--workers" not in text


def test_json_is_all_that_is_on_stdout(folder, tmp_path):
    done = run(folder, tmp_path, "--methods", "hold-last", "--settings", "future", "--json", "--no-pictures")
    content = json.loads(done.stdout)
    assert content["run"]["objects"] == 1
    assert {entry["method"] for entry in content["tables"]} == {"hold-last"}
    assert all(Path(path).is_file() for path in content["files"])
    assert "--no-pictures" in content["run"]["command"]


def test_settings_are_shown_in_their_own_order(folder, tmp_path):
    done = run(folder, tmp_path, "--methods", "hold-last", "--settings", "future,reconstruction")
    assert done.stdout.index("### Reconstruction") < done.stdout.index("### Future")
    assert "Unseen" not in done.stdout


def test_the_page_gets_its_section(folder, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Page\n")
    run(folder, tmp_path / "out", "--methods", "hold-last", "--docs", str(page), "--title", "Bars")
    assert "## Bars" in page.read_text()


def test_a_page_with_half_a_place_for_it_is_refused_before_anything_is_measured(folder, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("# Page\n\n<!-- evaluation: Bars -->\n")
    with pytest.raises(InputError, match=r"page\.md: expected <!-- evaluation: Bars --> and"):
        run(folder, tmp_path / "out", "--methods", "hold-last", "--docs", str(page), "--title", "Bars")
    assert not (tmp_path / "out").exists()


def test_recordings_of_one_thing_are_one_object(make_case, tmp_path):
    for name in ("single_lift_bar", "double_lift_bar"):
        case = replace(make_case(frames=10), name=name, object_name=name)
        save_case(case, tmp_path / f"{name}.case.npz")
    write_index(tmp_path)
    given = ("--methods", "hold-last", "--settings", "future", "--json", "--no-pictures")
    told = json.loads(run(tmp_path, tmp_path / "out", *given).stdout)["run"]
    assert (told["objects"], told["clips"]) == (1, 2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--methods", "hold-last,guess"), "no method 'guess'"),
        (("--methods", "hold-last,hold_last"), "named twice"),
        (("--methods", ","), "expected names"),
        (("--docs", "none.md"), "no such page"),
    ],
)
def test_what_cannot_be_done_is_said_before_anything_is_measured(folder, tmp_path, options, message):
    with pytest.raises(InputError, match=message):
        run(folder, tmp_path / "out", *options)
    assert not (tmp_path / "out").exists()


def test_a_setting_that_is_none(folder, tmp_path):
    done = run(folder, tmp_path, "--settings", "future,past")
    assert done.exit_code == 2
    assert "choose from reconstruction, future" in done.output
