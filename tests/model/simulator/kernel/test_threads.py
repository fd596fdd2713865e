"""How many threads a kernel takes, and that results do not depend on it."""

import threading

import pytest
import torch

from model.simulator.kernel import call
from model.simulator.kernel.threads import granted, kernel_threads, usable_cores


@pytest.mark.usefixtures("two_threads")
def test_as_many_as_torch_unless_told_otherwise():
    assert granted() == 2
    with kernel_threads(3):
        assert granted() == 3
        with kernel_threads(1):
            assert granted() == 1
        assert granted() == 3
    assert granted() == 2


def test_another_thread_is_not_told():
    found = list[int]()
    with kernel_threads(torch.get_num_threads() + 5):
        thread = threading.Thread(target=lambda: found.append(granted()))
        thread.start()
        thread.join()
    assert found == [torch.get_num_threads()]


def test_what_was_before_comes_back_after_an_error():
    with pytest.raises(ValueError, match="inside"), kernel_threads(7):
        raise ValueError("inside")
    assert granted() == torch.get_num_threads()


def test_a_kernel_takes_them_and_computes_the_same_bits(scene, monkeypatch):
    made, taken, results = scene(batch=(5,)), set[int](), []

    def counted() -> int:
        taken.add(granted())
        return granted()

    monkeypatch.setattr(call, "granted", counted)
    for threads in (1, 2, 3):
        with kernel_threads(threads):
            results.append(made.roll("kernel"))
    assert taken == {1, 2, 3}
    for rollout, gradients in results[1:]:
        assert torch.equal(rollout.points, results[0][0].points)
        assert all(torch.equal(gradients[name], results[0][1][name]) for name in gradients)


@pytest.mark.parametrize(("asked", "expected"), [("3", 3), ("0", 1)])
def test_the_environment_says_how_many_processes_share_the_cores(monkeypatch, asked, expected):
    monkeypatch.setenv("OMP_NUM_THREADS", asked)
    assert usable_cores() == expected


@pytest.mark.parametrize("asked", [None, "", "4,2"])
def test_without_a_number_there_all_cores_are_usable(monkeypatch, asked):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    if asked is not None:
        monkeypatch.setenv("OMP_NUM_THREADS", asked)
    assert usable_cores() >= 1
