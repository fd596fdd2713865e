import threading
import time

import pytest
import torch

from model.gap.side_by_side import side_by_side
from model.simulator.kernel.threads import granted, kernel_threads


def test_results_come_in_the_order_of_the_items_however_long_each_takes():
    def slow_first(number):
        time.sleep(0.05 if number == 0 else 0.0)
        return number**2

    for cores in (1, 2, 4):
        with kernel_threads(cores):
            assert side_by_side(slow_first, list(range(6))) == [0, 1, 4, 9, 16, 25]
            assert side_by_side(slow_first, []) == []


def test_as_many_are_at_work_as_there_are_cores():
    met = threading.Barrier(3)
    with kernel_threads(3):
        side_by_side(lambda _: met.wait(timeout=20.0), range(3))


def test_on_one_core_it_is_the_callers_thread():
    with kernel_threads(1):
        found = side_by_side(lambda _: threading.get_ident(), range(3))
    assert set(found) == {threading.get_ident()}


def test_each_has_its_share_of_the_cores_and_the_last_has_all():
    seen, alone = {}, threading.Event()

    def work(name):
        if name == "short":
            met.wait(timeout=20.0)
            seen[name] = granted(), torch.get_num_threads()
            taken.wait(timeout=20.0)
            return
        met.wait(timeout=20.0)
        seen[name] = granted(), torch.get_num_threads()
        taken.wait(timeout=20.0)
        assert alone.wait(timeout=20.0)
        # the other is done by now, or is in a moment
        end = time.monotonic() + 20.0
        while granted() < 4 and time.monotonic() < end:
            time.sleep(0.01)
        seen["last"] = granted()

    met, taken = threading.Barrier(2), threading.Barrier(2)
    with kernel_threads(4):
        side_by_side(work, ["short", "long"], lambda done: alone.set())
    assert seen == {"short": (2, 1), "long": (2, 1), "last": 4}


@pytest.mark.parametrize("count", [1, 2])
def test_the_caller_keeps_its_threads(count):
    before = torch.get_num_threads()
    try:
        torch.set_num_threads(count)
        with kernel_threads(2):
            side_by_side(abs, [1, 2, 3])
        assert torch.get_num_threads() == count
    finally:
        torch.set_num_threads(before)


def test_progress_is_told_in_the_callers_thread():
    told = []
    with kernel_threads(2):
        side_by_side(abs, [1, -2, 3], lambda done: told.append((done, threading.get_ident())))
    assert told == [(count, threading.get_ident()) for count in (1, 2, 3)]


def test_an_error_is_raised_and_what_is_under_way_is_abandoned():
    begun, ended, later = threading.Event(), threading.Event(), []

    def work(name):
        if name == "fails":
            assert begun.wait(timeout=20.0)
            raise ValueError("no twin of that")
        if name == "waits":
            begun.set()
            try:
                end = time.monotonic() + 20.0
                while time.monotonic() < end:
                    granted()  # as kernels do in each frame
                    time.sleep(0.01)
            finally:
                ended.set()
            return
        later.append(name)

    start = time.monotonic()
    with kernel_threads(2), pytest.raises(ValueError, match="no twin of that"):
        side_by_side(work, ["waits", "fails", *map(str, range(50))])
    assert ended.is_set()
    assert time.monotonic() - start < 15.0
    assert len(later) < 50
