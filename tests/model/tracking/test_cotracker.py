import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import torch

from model.errors import InputError, MissingDependencyError
from model.tracking.cotracker import CoTracker
from model.types import Frames


class StandIn(torch.nn.Module):
    """Has the interface of `cotracker.predictor.CoTrackerPredictor`; everything moves (1, 2) px a frame."""

    def __init__(self, checkpoint="./checkpoints/scaled_offline.pth", offline=True, v2=False, window_len=60):
        super().__init__()
        if b"broken" in Path(checkpoint).read_bytes():
            raise RuntimeError("Error(s) in loading state_dict\nand more")
        self.offline = offline

    def forward(
        self,
        video,
        queries=None,
        segm_mask=None,
        grid_size=0,
        grid_query_frame=0,
        backward_tracking=False,
    ):
        assert video.ndim == 5
        assert video.shape[2] == 3
        assert video.dtype == torch.float32
        assert video.max() > 1.0
        assert queries.shape[0] == 1
        assert queries.shape[2] == 3
        frame = torch.arange(video.shape[1])[None, :, None]
        since = frame - queries[:, None, :, 0]
        step = torch.tensor([1.0, 2.0])
        tracks = queries[:, None, :, 1:] + since[..., None] * step
        visible = torch.ones_like(since, dtype=torch.bool)
        if not backward_tracking:
            visible = since >= 0
        inside = tracks[..., 0] < video.shape[4]
        return tracks, visible & inside


@pytest.fixture
def package(monkeypatch):
    root, predictor = ModuleType("cotracker"), ModuleType("cotracker.predictor")
    predictor.CoTrackerPredictor = StandIn
    monkeypatch.setitem(sys.modules, "cotracker", root)
    monkeypatch.setitem(sys.modules, "cotracker.predictor", predictor)
    monkeypatch.delenv("MATPHYS_COTRACKER", raising=False)


@pytest.fixture
def clip():
    images = np.random.default_rng(0).integers(0, 256, (5, 24, 32, 3), np.uint8)
    return Frames(images, np.arange(5) / 30.0, "made", "0" * 64)


def test_coordinates_query_frame_and_both_directions(package, clip, tmp_path, monkeypatch):
    weights = tmp_path / "scaled_offline.pth"
    weights.write_bytes(b"weights")
    monkeypatch.setenv("MATPHYS_COTRACKER", str(weights))
    tracker = CoTracker()
    queries = np.array([[10.0, 12.0], [30.0, 5.0]], np.float32)
    tracks = tracker(clip, queries, 2)
    assert tracks.points.shape == (5, 2, 2)
    np.testing.assert_allclose(tracks.points[2], queries)
    np.testing.assert_allclose(tracks.points[0, 0], [8.0, 8.0])
    np.testing.assert_allclose(tracks.points[4, 0], [12.0, 16.0])
    np.testing.assert_array_equal(tracks.visible[:, 0], True)
    np.testing.assert_array_equal(tracks.visible[:, 1], [True, True, True, True, False])
    assert tracker.weights is not None
    assert len(tracker.weights) == 64
    assert tracker(clip, queries[:0], 2).points.shape == (5, 0, 2)


def test_without_the_package_the_pip_line_is_given(monkeypatch):
    monkeypatch.setitem(sys.modules, "cotracker", None)
    with pytest.raises(MissingDependencyError, match="pip install"):
        CoTracker()


def test_without_the_checkpoint_the_variable_is_named(package, tmp_path):
    with pytest.raises(MissingDependencyError, match="MATPHYS_COTRACKER"):
        CoTracker()
    with pytest.raises(MissingDependencyError, match="no file"):
        CoTracker(tmp_path / "absent.pth")


def test_a_wrong_checkpoint_is_one_clear_line(package, tmp_path):
    broken = tmp_path / "other.pth"
    broken.write_bytes(b"broken")
    with pytest.raises(InputError, match=r"other.pth is not a checkpoint of CoTracker3 offline: Error.s. in"):
        CoTracker(broken)
