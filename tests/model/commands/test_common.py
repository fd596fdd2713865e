import pytest
import torch

from model.commands.common import default_to_one_thread


@pytest.mark.usefixtures("two_threads")
@pytest.mark.parametrize(("said", "threads"), [(None, 1), ("2", 2)])
def test_there_is_one_thread_unless_the_user_says_otherwise(monkeypatch, blas_threads, said, threads):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    if said is not None:
        monkeypatch.setenv("OMP_NUM_THREADS", said)
    default_to_one_thread()
    assert torch.get_num_threads() == threads
    assert blas_threads() == {threads}
