import os
import signal
import subprocess
import sys
import time

from model.crew import crew

PARENT = """
import os, sys, time
from model.crew import crew

if __name__ == "__main__":
    with crew(1) as pool:
        print(pool.submit(os.getpid).result(), flush=True)
        pool.submit(time.sleep, 600).result()
"""


def test_work_is_shared_and_comes_back():
    with crew(2) as pool:
        assert list(pool.map(abs, [-1, 2, -3])) == [1, 2, 3]
        assert pool.submit(os.getenv, "OMP_NUM_THREADS").result() is not None


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
