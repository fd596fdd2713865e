import os
import signal
import subprocess
import time

import pytest

from worker.guard import Guard


@pytest.fixture
def guard():
    guard = Guard()
    yield guard
    guard.close()


@pytest.fixture
def group():
    """A process group of two that would sleep for long."""
    process = subprocess.Popen(["sh", "-c", "sleep 600 & sleep 600"], start_new_session=True)
    yield process
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def test_a_group_that_is_over_its_time_is_killed(guard, group, eventually, living):
    eventually(lambda: len(living(group=group.pid)) == 3)
    guard.watch(group.pid, 0.2)
    eventually(lambda: not living(group=group.pid), 5.0)
    assert group.wait() == -signal.SIGKILL


def test_a_released_group_lives(guard, group):
    guard.watch(group.pid, 0.3)
    guard.release()
    time.sleep(0.6)
    assert group.poll() is None


def test_the_last_word_counts(guard, group, eventually, living):
    guard.watch(group.pid, 600)
    guard.watch(group.pid, 0.1)
    eventually(lambda: not living(group=group.pid), 5.0)


def test_a_group_ends_with_whoever_watched_it(group, eventually, living):
    pid = os.fork()
    if pid == 0:
        Guard().watch(group.pid, 600)
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(pid, 0)
    eventually(lambda: not living(group=group.pid), 5.0)


def test_a_guard_that_was_killed_is_replaced(guard, group, eventually, living):
    os.kill(guard._pid, signal.SIGKILL)
    os.waitid(os.P_PID, guard._pid, os.WEXITED | os.WNOWAIT)
    guard.watch(group.pid, 0.1)
    eventually(lambda: not living(group=group.pid), 5.0)


def test_a_guard_is_not_stopped_by_what_stops_a_worker(guard, group, eventually, living):
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        os.kill(guard._pid, number)
    guard.watch(group.pid, 0.1)
    eventually(lambda: not living(group=group.pid), 5.0)
