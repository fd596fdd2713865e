import json
import os
import signal
import subprocess
import sys
import time

import pytest

from worker.guard import Guard
from worker.horse import FAULT, Horse


@pytest.fixture
def guard():
    guard = Guard()
    yield guard
    guard.close()


@pytest.fixture
def ride(guard):
    def start(work, limit_s=30.0):
        return Horse(work, guard, limit_s, worker="w", job="j", attempt=1)

    return start


def test_it_ends_with_the_code_of_its_work(ride):
    assert ride(lambda: 0).wait(10) == 0
    assert ride(lambda: 75).wait(10) == 75


def test_an_error_never_reaches_the_code_it_was_forked_from(ride, capfd):
    def fail():
        raise RuntimeError("oops")

    assert ride(fail).wait(10) == FAULT
    assert ride(sys.exit).wait(10) == FAULT


def test_it_runs_until_it_ends(ride):
    horse = ride(lambda: time.sleep(0.3) or 0)
    assert horse.wait(0.01) is None
    assert horse.wait(10) == 0


def test_it_is_killed_with_what_it_started(ride, tmp_path, eventually, living):
    def work():
        (tmp_path / "pid").write_text(str(subprocess.Popen(["sleep", "600"]).pid))
        time.sleep(600)

    horse = ride(work)
    eventually(lambda: (tmp_path / "pid").exists() and (tmp_path / "pid").read_text())
    horse.stop()
    assert horse.wait(10) == -signal.SIGKILL
    eventually(lambda: not living(pid=int((tmp_path / "pid").read_text())))


def test_what_it_started_does_not_outlive_it(ride, tmp_path, eventually, living):
    def work():
        (tmp_path / "pid").write_text(str(subprocess.Popen(["sleep", "600"]).pid))
        return 0

    assert ride(work).wait(10) == 0
    eventually(lambda: not living(pid=int((tmp_path / "pid").read_text())))


def test_its_time_is_limited_however_deep_it_is(ride):
    def work():
        signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
        time.sleep(600)

    began = time.monotonic()
    assert ride(work, limit_s=0.3).wait(10) == -signal.SIGKILL
    assert time.monotonic() - began < 5


def test_it_can_be_given_less_time(ride):
    horse = ride(lambda: time.sleep(600) or 0)
    horse.kill_within(0.1)
    assert horse.wait(10) == -signal.SIGKILL


def test_signals_to_stop_a_worker_do_not_stop_its_horse(ride, tmp_path, eventually):
    def work():
        (tmp_path / "ready").touch()
        time.sleep(0.5)
        return 0

    horse = ride(work)
    eventually((tmp_path / "ready").exists)
    os.kill(horse.pid, signal.SIGTERM)
    os.kill(horse.pid, signal.SIGINT)
    assert horse.wait(10) == 0


def test_what_it_prints_goes_into_the_log_with_its_job(ride, capsys, caplog):
    def work():
        os.write(1, b"from C\n")
        os.write(2, b'{"at": "now", "message": "a log line"}\n')
        return 0

    assert ride(work).wait(10) == 0
    assert json.loads(capsys.readouterr().err) == {"at": "now", "message": "a log line"}
    (said,) = [each for each in caplog.records if each.name == "matphys.horse"]
    assert (said.getMessage(), said.job, said.attempt) == ("from C", "j", 1)


@pytest.mark.parametrize("guarded", [True, False])
def test_it_ends_with_its_worker(tmp_path, eventually, guarded, living):
    """Killed, the worker can say nothing to anybody; and should the guard be gone too, the kernel ends it."""
    worker = os.fork()
    if worker == 0:

        def work():
            (tmp_path / "child").write_text(str(subprocess.Popen(["sleep", "600"]).pid))
            (tmp_path / "horse").write_text(str(os.getpid()))
            time.sleep(600)

        guard = Guard()
        (tmp_path / "guard").write_text(str(guard._pid))
        Horse(work, guard, 600.0, worker="w", job="j", attempt=1)
        time.sleep(600)
    eventually(lambda: (tmp_path / "horse").exists() and (tmp_path / "horse").read_text())
    pids = {name: int((tmp_path / name).read_text()) for name in ("guard", "horse", "child")}
    if not guarded:
        os.kill(pids["guard"], signal.SIGKILL)
    os.kill(worker, signal.SIGKILL)
    os.waitpid(worker, 0)
    eventually(lambda: not living(pid=pids["horse"]))
    if guarded:
        eventually(lambda: not living(pid=pids["child"]))
    else:
        os.kill(pids["child"], signal.SIGKILL)
