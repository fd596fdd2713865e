"""What is diagnosed of a recording, and what is said of the rest."""

import numpy as np
import pytest

from benchmarks.gap.cantilever import Cantilever
from model.observation import write_observation
from model.pipeline import diagnose


class Asked(Exception):
    """Ends a diagnosis where it would begin."""


@pytest.mark.parametrize("held", [0.0, 0.3])
def test_frames_in_which_something_unseen_holds_the_object_are_left_out(tmp_path, monkeypatch, held):
    """A beam held straight by a finger that the recording does not know of: no twin rests there."""
    seen = Cantilever().recording(1.2, held)
    rng = np.random.default_rng(0)
    seen.points[:] += rng.normal(0, 1e-5, seen.points.shape).astype(np.float32)
    path = tmp_path / "beam.npz"
    write_observation(path, seen)
    taken = []

    def ask(observation, twin, transfer, progress):
        taken.append(observation)
        raise Asked

    monkeypatch.setattr("model.gap.diagnose.diagnose", ask)
    with pytest.raises(Asked):
        diagnose(path, None, None, lambda stage, share: None)
    (asked,) = taken
    assert asked.times[0] == pytest.approx(held, abs=0.011)
    assert len(asked.points) == len(asked.controllers) == len(asked.times) < len(seen.times) + (held == 0.0)
