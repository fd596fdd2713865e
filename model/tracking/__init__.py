"""Frames → 2D tracks; the default needs no download."""

from model.tracking.base import Tracker
from model.tracking.cotracker import CoTracker
from model.tracking.opencv import OpenCVTracker
from model.tracking.queries import sample_queries

ALL_TRACKERS: tuple[type[Tracker], ...] = (OpenCVTracker, CoTracker)

__all__ = ["ALL_TRACKERS", "CoTracker", "OpenCVTracker", "Tracker", "sample_queries"]
