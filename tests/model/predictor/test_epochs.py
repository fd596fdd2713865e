"""Which checkpoint is meant by its name; that the best was validated is tested with the command."""

import os

import pytest

from model.errors import InputError
from model.predictor.epochs import newest


def test_last_and_best_are_those_of_the_run_that_was_written_to_last(tmp_path):
    for number, name in enumerate(("run-0/checkpoints/best", "run-1/checkpoints/last", "run-2/metrics")):
        path = tmp_path / f"{name}.ckpt"
        path.parent.mkdir(parents=True)
        path.touch()
        os.utime(path, (100 - number, 100 - number))
    with pytest.raises(InputError, match=r"last\.ckpt"):
        newest(tmp_path, "last")
    assert newest(tmp_path, "best") == tmp_path / "run-0" / "checkpoints" / "best.ckpt"
    os.utime(tmp_path / "run-1" / "checkpoints" / "last.ckpt", (200, 200))
    assert newest(tmp_path, "last") == tmp_path / "run-1" / "checkpoints" / "last.ckpt"
