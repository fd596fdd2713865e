import json
import subprocess
import sys

import pytest


def look(*files) -> dict:
    done = subprocess.run(
        [sys.executable, "-I", "-m", "worker.inspection", json.dumps(files)],
        capture_output=True,
        text=True,
        check=False,
    )
    return json.loads(done.stdout) if done.stdout else {"code": done.returncode, "said": done.stderr}


def test_it_names_the_first_file_that_is_refused(tmp_path):
    (tmp_path / "a").write_bytes(b'{"intrinsics": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}')
    (tmp_path / "b").write_bytes(b"not JSON")
    good, bad = ("one", "camera", str(tmp_path / "a")), ("two", "camera", str(tmp_path / "b"))
    assert look(good) == {"suffixes": {"one": ".json"}}
    verdict = look(good, bad)
    assert verdict["refused"] == "two"
    assert verdict["unknown_format"] is True


def test_only_known_inspections_are_run(tmp_path):
    assert look(("x", "os", str(tmp_path)))["code"] != 0


CONFINED = """
import resource, sys
from worker.inspection.__main__ import _confine
_confine()
try:
    {attempt}
except BaseException as error:
    sys.stdout.write(type(error).__name__)
else:
    sys.stdout.write("done")
"""


@pytest.mark.parametrize(
    ("attempt", "outcome"),
    [
        ("bytearray(3 << 30)", "MemoryError"),
        ("open('{folder}/x', 'wb', buffering=0).write(b'x' * 10)", "OSError"),
        ("[open('/dev/null') for _ in range(100)]", "OSError"),
        ("resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))", "ValueError"),
        ("bytearray(100)", "done"),
    ],
)
def test_it_gives_up_what_it_does_not_need(tmp_path, attempt, outcome):
    code = CONFINED.format(attempt=attempt.format(folder=tmp_path))
    # As any user: root may raise limits again, which is why it is no root that runs the service.
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, check=False
    )
    if outcome == "ValueError" and done.stdout == "done":
        pytest.skip("root may raise its limits again")
    assert done.stdout == outcome, done.stderr


def test_an_endless_look_is_ended(tmp_path):
    code = (
        "from worker.inspection import __main__ as it; it.LIMITS[it.resource.RLIMIT_CPU] = 1\n"
        "it._confine()\n"
        "while True: pass"
    )
    done = subprocess.run([sys.executable, "-c", code], timeout=30, check=False)
    assert done.returncode < 0
