import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "faults" / "run.py"


@pytest.mark.slow
def test_nothing_is_lost_under_faults():
    """The short version; the long one is `python benchmarks/faults/run.py`."""
    done = subprocess.run(
        [sys.executable, str(SCRIPT), "--jobs", "20", "--quick"], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "nothing lost, nothing twice, nothing left" in done.stdout
    assert done.stdout.count("kill -9") >= 8
