"""README.md and docs/ say what is so: their Python runs, their options, files and variables exist."""

import json
import re
import shlex
import shutil
from pathlib import Path

import click
import numpy as np
import pytest

from model.cli import matphys
from model.evaluation.matphys import MatPhysMethod
from model.gap.effects import ALL_EFFECTS
from model.reconstruction.camera_file import read_camera_file

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
BUNDLE_PAGE = ROOT / "docs" / "twin-bundle.md"
ELSEWHERE = ("gap-", "service")
"""Pages of which other tests take care, since they need a running service or hours."""
PAGES = [
    README,
    *sorted(page for page in (ROOT / "docs").glob("*.md") if not page.name.startswith(ELSEWHERE)),
]


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text_of(page), re.DOTALL | re.MULTILINE)


def named(page: Path):
    return page.relative_to(ROOT).as_posix()


def commands(page: Path) -> list[list[str]]:
    """Every line of a shell block that calls `matphys`, as words."""
    lines = "\n".join(blocks(page, "bash")).splitlines()
    return [shlex.split(line, comments=True) for line in lines if line.startswith("matphys ")]


def known_options() -> set[str]:
    groups = [matphys, *matphys.commands.values()]
    options = {option for group in groups for parameter in group.params for option in parameter.opts}
    return {option for option in options if option.startswith("--")} | {"--help", "--version"}


@pytest.fixture
def folder_with_a_twin(tmp_path, monkeypatch):
    """Where the pages' code runs: a bundle lies where `make demo` leaves one."""
    monkeypatch.chdir(tmp_path)
    exec(compile(blocks(BUNDLE_PAGE, "python")[0], named(BUNDLE_PAGE), "exec"), {})
    (tmp_path / "out").mkdir()
    shutil.copy("cube.twin.zip", "out/demo.twin.zip")
    return tmp_path


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "python")], ids=named)
def test_python_of_a_page_runs_from_top_to_bottom(page, folder_with_a_twin):
    names = {"__name__": "page"}
    for block in blocks(page, "python"):
        if "service.client" not in block:  # tests/service has a service for it
            exec(compile(block, named(page), "exec"), names)


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_commands_of_a_page_are_understood(page):
    for _, command, *words in commands(page):
        known = matphys.commands[command]
        known.make_parser(click.Context(known, **known.context_settings)).parse_args(args=words)


def test_readme_names_real_options_alone():
    prose = re.sub(r"^```.*?^```", "", text_of(README), flags=re.DOTALL | re.MULTILINE)
    spans = [span for span in re.findall(r"`([^`\n]+)`", prose) if "benchmarks/" not in span]
    found = {option for span in spans for option in re.findall(r"--[a-z][a-z-]*", span)}
    assert len(found) > 20
    assert found <= known_options()


def test_readme_names_every_option_of_twin_and_simulate():
    missing = [
        option
        for command in ("twin", "simulate", "inspect", "export")
        for parameter in matphys.commands[command].params
        for option in parameter.opts
        if option.startswith("--") and not re.search(rf"{option}(?![a-z-])", text_of(README))
    ]
    assert missing == []


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_variables_of_a_page_are_read_by_the_code(page):
    code = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "model").rglob("*.py"))
    code += "".join(path.read_text(encoding="utf-8") for path in (ROOT / "benchmarks").rglob("*.py"))
    for variable in set(re.findall(r"\b(?:MATPHYS|OPENAI)_[A-Z0-9_]+\b", text_of(page))):
        assert f'"{variable}"' in code, variable


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_files_that_a_page_links_to_exist(page):
    for target in re.findall(r"\]\(([^)#]+)\)", text_of(page)):
        if not target.startswith("http"):
            assert (page.parent / target).exists(), target


def test_make_targets_of_the_readme_exist():
    targets = set(re.findall(r"^([a-z]+):", text_of(ROOT / "Makefile"), re.MULTILINE))
    mentioned = set(re.findall(r"(?:^|`)make ([a-z]+)", text_of(README), re.MULTILINE))
    assert {"demo", "test"} <= mentioned <= targets


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "json")], ids=named)
def test_camera_files_of_a_page_are_read(page, tmp_path):
    path = tmp_path / "camera.json"
    for block in blocks(page, "json"):
        path.write_text(block, encoding="utf-8")
        camera = read_camera_file(path, width=640, height=480)
        assert np.array_equal(camera.intrinsics[0], [610.0, 0.0, 319.5])
        if "world_from_camera" in json.loads(block):
            assert camera.world_from_camera[:3, 2] == pytest.approx([0.0, np.sqrt(0.5), -np.sqrt(0.5)])


def test_tables_of_the_predictor_are_of_the_one_that_ships():
    """Trained again it is another one: chaotic clips alone move the means by millimetres.

    Ablations are compared with the network that was trained as they were; the text says which one that is.
    """
    page = text_of(ROOT / "docs" / "evaluation.md")
    sections = re.findall(r"<!-- evaluation: (.*?) -->(.*?)<!-- end of", page, re.DOTALL)
    assert sections
    ships = MatPhysMethod().weights()
    weights = {
        title: set(re.findall(r"`(?:matphys|full)(?:-open-loop)?` ([0-9a-f]{16})\b", body))
        for title, body in sections
    }
    beside = {title: of for title, of in weights.items() if title.startswith("Ablations")}
    assert {title: of for title, of in weights.items() if title not in beside} == {
        title: {ships} for title in weights if title not in beside
    }
    prose = page.split("<!-- evaluation:")[0]
    assert all(len(of) == 1 and f"`{next(iter(of))}`" in prose for of in beside.values())


def test_the_catalogue_is_the_one_that_there_is():
    """Every effect with its parameters, their units, and whether it is looked for in parts of the body."""
    page = text_of(ROOT / "docs" / "diagnosis.md")
    rows = re.findall(r"^\| `(\w+)` \| [^|]+ \| (`[^|]+) \| *(part)? *\|$", page, re.MULTILINE)
    said = {name: (parameters, part == "part") for name, parameters, part in rows}
    is_so = {
        effect.name: (
            ", ".join(f"`{name}` [{q.unit}]" for name, q in effect.quantities.items()),
            effect().local,
        )
        for effect in ALL_EFFECTS
    }
    assert said == is_so
