"""docs/service.md says what is so: its commands and its Python run, its limits and paths are real."""

import os
import re
import shutil
import subprocess
import threading
from dataclasses import fields
from pathlib import Path

import pytest

from service.app import create_app
from service.settings import Settings

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/service.md").read_text()


def block(language):
    (found,) = re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
    return found


@pytest.fixture
def at_work(serving, clip, tmp_path, monkeypatch):
    """A folder with a clip, URL and KEY, and somebody who does what a worker does."""
    (tmp_path / "work").mkdir()
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "clip.mp4").write_bytes(clip)
    monkeypatch.chdir(tmp_path / "folder")
    monkeypatch.setenv("URL", serving.url)
    monkeypatch.setenv("KEY", serving.keys.create("page", "default", ("submit", "read"))[1])
    over = threading.Event()

    def work():
        while not over.wait(0.05):
            queued, _ = serving.records.list("default", "twin", status="queued")
            exports = [
                child
                for twin in serving.records.list("default", "twin")[0]
                for child in serving.records.children(twin.id)
                if child.status == "queued"
            ]
            for record in (*queued, *exports):
                name = "twin.ply" if record.kind == "export" else "bundle.twin.zip"
                serving.finish(record.id, {name: b"content"}, tmp_path / "work")

    worker = threading.Thread(target=work)
    worker.start()
    yield tmp_path / "folder"
    over.set()
    worker.join()


def test_its_python_runs(at_work, capsys):
    exec(compile(block("python"), "docs/service.md", "exec"), {"__name__": "page"})
    assert (at_work / "mine.twin.zip").read_bytes() == b"content"
    assert (at_work / "mine.ply").exists()
    assert "succeeded" in capsys.readouterr().out


def test_python_of_the_readme_runs(at_work):
    (code,) = (
        block
        for block in re.findall(
            r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(), re.DOTALL | re.MULTILINE
        )
        if "service.client" in block
    )
    (at_work / "out").mkdir()
    shutil.copy(at_work / "clip.mp4", at_work / "out" / "demo.mp4")
    exec(compile(code, "README.md", "exec"), {"__name__": "page"})
    assert (at_work / "out" / "served.twin.zip").read_bytes() == b"content"


def test_its_commands_run(at_work):
    if shutil.which("curl") is None:
        pytest.skip("no curl on the PATH")
    script = block("bash").replace('/events"', '/events"; sleep 0.2')
    run = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", script],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env=dict(os.environ),
    )
    assert run.returncode == 0, run.stderr + run.stdout
    assert (at_work / "clip.twin.zip").read_bytes() == b"content"
    assert '"succeeded"' in run.stdout


def test_its_limits_are_the_defaults():
    rows = re.findall(r"^\| `MATPHYS_(\w+)` \| (\d+) \|", PAGE, re.MULTILINE)
    numbers = {each.name: each.default for each in fields(Settings) if each.type in (int, float)}
    assert {name.lower(): float(value) for name, value in rows} == numbers


def test_its_paths_are_served(settings):
    served = {
        (method.upper(), path)
        for path, methods in create_app(settings).openapi()["paths"].items()
        for method in methods
    }
    named = set(re.findall(r"`(GET|POST|DELETE) (/[^`]*)`", PAGE)) - {("GET", "/openapi.json")}
    assert len(named) > 10
    assert named <= served


def test_what_it_names_is_there():
    code = "".join(
        path.read_text() for folder in ("service", "worker") for path in (ROOT / folder).rglob("*.py")
    )
    for name in set(re.findall(r"`(matphys_\w+)`", PAGE)):
        assert name in code, name
    compose = (ROOT / "docker-compose.yml").read_text()
    settings = {f"MATPHYS_{each.name.upper()}" for each in fields(Settings)}
    for name in set(re.findall(r"`(MATPHYS_\w+)`", PAGE)):
        assert name in settings or f'"{name}"' in code or name in compose, name
    for target in re.findall(r"\]\(([^)#]+)\)", PAGE):
        assert target.startswith("http") or (ROOT / "docs" / target).exists(), target
