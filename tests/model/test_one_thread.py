"""Work on one thread, and what there was before comes back."""

import pytest
import torch

from model.one_thread import one_thread


def test_there_is_one_thread_inside_and_as_many_as_before_after(two_threads, blas_threads):
    with one_thread():
        assert torch.get_num_threads() == 1
        assert blas_threads() == {1}
    assert torch.get_num_threads() == 2
    assert blas_threads() == {2}


def test_what_was_before_comes_back_after_an_error(two_threads, blas_threads):
    with pytest.raises(ValueError, match="inside"), one_thread():
        raise ValueError("inside")
    assert torch.get_num_threads() == 2
    assert blas_threads() == {2}
