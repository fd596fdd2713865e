import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def requirements():
    spec = importlib.util.spec_from_file_location("requirements", ROOT / "deploy/requirements.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_front_gets_what_it_needs_and_no_torch(requirements):
    needed = requirements.front_requirements(ROOT / "pyproject.toml")
    assert any(line.startswith("fastapi") for line in needed)
    assert not any(line.startswith(("torch", "scipy")) for line in needed)


def test_a_package_that_is_no_dependency_any_more_is_noticed(requirements, tmp_path):
    pyproject = tmp_path / "pyproject.toml"
    pyproject.write_text('[project]\ndependencies = ["fastapi>=0.1", "torch>=2"]\n')
    with pytest.raises(KeyError, match="scipy"):
        requirements.front_requirements(pyproject)
