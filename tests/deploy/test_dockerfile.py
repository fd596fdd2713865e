import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCKERFILE = ROOT / "Dockerfile"


def lint(path):
    hadolint = shutil.which("hadolint", path=Path(sys.executable).parent)
    return subprocess.run([hadolint, "--no-color", str(path)], capture_output=True, text=True, check=False)


def test_hadolint_finds_nothing(tmp_path):
    result = lint(DOCKERFILE)
    assert result.returncode == 0, result.stdout
    worse = tmp_path / "Dockerfile"
    worse.write_text(DOCKERFILE.read_text().replace("FROM base AS front", "FROM base AS front\nRUN cd /tmp"))
    assert lint(worse).returncode != 0


def test_everything_that_is_copied_is_there_and_let_through():
    let_through = set(re.findall(r"^!(\S+)$", (ROOT / ".dockerignore").read_text(), re.M))
    copied = [
        source
        for line in DOCKERFILE.read_text().splitlines()
        if line.startswith("COPY ") and "--from" not in line
        for source in line.split()[1:-1]
    ]
    assert copied
    for source in copied:
        assert (ROOT / source).exists(), source
        assert source.split("/")[0] in let_through, source


def test_no_secret_and_no_history_goes_to_the_builder():
    assert (ROOT / ".dockerignore").read_text().splitlines()[1] == "*"


@pytest.mark.parametrize("stage", ["front", "worker"])
def test_a_stage_that_runs_has_a_user_and_a_health_check(stage):
    text = DOCKERFILE.read_text().split(f" AS {stage}\n")[1].split("\nFROM ")[0]
    assert "USER 10001:10001" in text
    assert "HEALTHCHECK" in text
    assert "ENTRYPOINT [" in text


def test_what_the_images_call_is_installed_by_the_package():
    scripts = (ROOT / "pyproject.toml").read_text().split("[project.scripts]")[1].split("\n[")[0]
    for name in re.findall(r'ENTRYPOINT \["([\w-]+)"\]', DOCKERFILE.read_text()):
        assert f"{name} = " in scripts
