from model.registry import by_name
from model.tracking import ALL_TRACKERS, OpenCVTracker


def test_every_tracker_is_chosen_by_its_own_name():
    assert by_name(ALL_TRACKERS, "opencv", "tracking") is OpenCVTracker is ALL_TRACKERS[0]
    assert len({tracker.name for tracker in ALL_TRACKERS}) == len(ALL_TRACKERS)
    assert all(tracker.version for tracker in ALL_TRACKERS)
