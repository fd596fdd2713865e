import os
import signal
import subprocess
import sys
import time

import pytest

from model.crew import crew

PARENT = """
import os, sys, time
from model.crew import crew

if __name__ == "__main__":
    with crew(1) as pool:
        print(pool.submit(os.getpid).result(), flush=True)
        pool.submit(time.sleep, 600).result()
"""
COUNTING = """
import scipy.linalg
from threadpoolctl import threadpool_info
from model.crew import crew

def threads():
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

if __name__ == "__main__":
    with crew(1) as pool:
        print(pool.submit(threads).result())
"""


def test_work_is_shared_and_comes_back():
    with crew(2) as pool:
        assert list(pool.map(abs, [-1, 2, -3])) == [1, 2, 3]
        assert pool.submit(os.getenv, "OMP_NUM_THREADS").result() is not None


@pytest.mark.parametrize("said", [None, "2"])
def test_libraries_that_were_there_before_have_one_thread_too(tmp_path, said):
    script = tmp_path / "counting.py"
    script.write_text(COUNTING)
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    if said is not None:
        environment["OMP_NUM_THREADS"] = said
    counted = subprocess.run(
        [sys.executable, str(script)], env=environment, capture_output=True, text=True, check=True
    )
    assert counted.stdout.strip() == f"{{{min(int(said or 1), os.cpu_count() or 1)}}}"


def test_workers_end_with_a_parent_that_is_killed(tmp_path, living):
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    parent = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    with parent.stdout:
        child = int(parent.stdout.readline())
        assert living(pid=child)
        os.kill(parent.pid, signal.SIGKILL)
        parent.wait()
        end = time.monotonic() + 20.0
        while living(pid=child) and time.monotonic() < end:
            time.sleep(0.1)
    assert not living(pid=child)
