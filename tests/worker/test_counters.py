import pytest

from worker.counters import Counters
from worker.record import JobError


@pytest.fixture
def counters(client) -> Counters:
    return Counters(client)


def test_outcomes_are_counted_by_kind(counters, records, errand):
    made = [errand() for _ in range(3)] + [errand(kind="export", queue="exports")]
    for record in made:
        records.create(record)
    attempt = records.begin(made[0].id, "t", "w")
    records.succeed(made[0].id, attempt, [], {})
    records.crash(made[1].id, records.begin(made[1].id, "t", "w"), JobError(type="t", title="t", detail="d"))
    records.cancel(made[2].id)
    records.delete(made[0].id)
    assert counters.outcomes() == {
        ("errand", "accepted"): 3,
        ("errand", "succeeded"): 1,
        ("errand", "crashed"): 1,
        ("errand", "canceled"): 1,
        ("export", "accepted"): 1,
    }


def test_stages_are_measured(counters, records, errand):
    for seconds in (0.05, 2.0, 5000.0):
        record = errand()
        records.create(record)
        attempt = records.begin(record.id, "t", "w")
        records.advance(record.id, attempt, "two", 50.0, ("one", seconds))
        records.succeed(record.id, attempt, [], {}, ("two", seconds))
    stages = counters.stages()
    assert set(stages) == {("errand", stage) for stage in ("queued", "one", "two", "total")}
    one = stages["errand", "one"]
    assert one == stages["errand", "two"]
    assert (one.count, one.seconds) == (3, pytest.approx(5002.05))
    bounds = dict(one.buckets)
    assert list(bounds) == sorted(bounds)
    assert (bounds[0.1], bounds[1.0], bounds[3.0], bounds[1000.0]) == (1, 1, 2, 2)
    assert stages["errand", "total"].count == 3
