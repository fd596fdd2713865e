import asyncio
import threading
import time

import pytest
import redis.asyncio

from worker import progress as module
from worker.progress import LINE_LENGTH, LOG_LINES, follow
from worker.record import JobError


@pytest.fixture
def running(records, errand):
    record = errand()
    records.create(record)
    return record, records.begin(record.id, "token", "w")


def test_every_change_is_an_event_and_the_last_is_the_end(records, progress, running):
    record, attempt = running
    records.advance(record.id, attempt, "walking", 10.0)
    records.fail(record.id, attempt, JobError(type="t", title="t", detail="d"))
    events = list(progress.follow(record.id))
    assert [(event.status, event.stage) for event in events] == [
        ("queued", ""),
        ("running", "starting"),
        ("running", "walking"),
        ("failed", "walking"),
    ]
    assert [event.final for event in events] == [False, False, False, True]
    assert events[2].progress == 10.0
    assert events[0].at <= events[-1].at


def test_following_resumes_after_the_last_event_seen(records, progress, running):
    record, attempt = running
    seen = progress.read(record.id)
    records.succeed(record.id, attempt, [], {})
    assert [event.status for event in progress.follow(record.id, seen[-1].id)] == ["succeeded"]
    assert [event.status for event in progress.read(record.id, seen[0].id)] == ["running", "succeeded"]


def test_following_waits_for_what_comes(records, progress, running, monkeypatch):
    monkeypatch.setattr(module, "BLOCK_S", 0.1)
    record, attempt = running
    later = threading.Timer(0.5, lambda: records.succeed(record.id, attempt, [], {}))
    later.start()
    events = list(progress.follow(record.id))
    # it may still be reading Redis's answer, and must not lose its connection to the end of the test
    later.join()
    assert None in events, "silence is told, so that a connection can be kept open"
    assert events[-1].status == "succeeded"


def test_following_ends_when_the_job_is_deleted(records, progress, running, monkeypatch):
    monkeypatch.setattr(module, "BLOCK_S", 0.1)
    record, _ = running
    following = progress.follow(record.id)
    next(following)
    records.delete(record.id)
    assert [event for event in following if event is not None and event.final] == []


def test_an_event_loop_can_follow_too(redis_server, records, running, monkeypatch):
    monkeypatch.setattr(module, "BLOCK_S", 0.1)
    record, attempt = running
    later = threading.Timer(0.3, lambda: records.succeed(record.id, attempt, [], {}))
    later.start()

    async def statuses(after="0"):
        async with redis.asyncio.Redis.from_url(redis_server.url, decode_responses=True) as client:
            return [event async for event in follow(client, record.id, after) if event is not None]

    events = asyncio.run(statuses())
    later.join()
    assert [event.status for event in events] == ["queued", "running", "succeeded"]
    assert [event.status for event in asyncio.run(statuses(events[1].id))] == ["succeeded"]
    records.delete(record.id)
    assert asyncio.run(statuses()) == []


def test_who_has_seen_the_end_is_not_kept_waiting(redis_server, records, progress, running):
    record, attempt = running
    records.succeed(record.id, attempt, [], {})
    end = progress.read(record.id)[-1]
    assert end.final

    async def more() -> list[object]:
        async with redis.asyncio.Redis.from_url(redis_server.url, decode_responses=True) as client:
            return [event async for event in follow(client, record.id, end.id)]

    assert asyncio.run(more()) == []
    assert list(progress.follow(record.id, end.id)) == []


def test_events_are_trimmed(records, progress, client, running):
    record, attempt = running
    for step in range(1500):
        records.advance(record.id, attempt, "walking", step / 15)
    assert 500 < len(progress.read(record.id)) < 800


def test_logs_keep_the_newest_lines_and_no_endless_ones(progress, running):
    job = running[0].id
    progress.log(job, [f"line {number}" for number in range(LOG_LINES + 5)])
    progress.log(job, [])
    progress.log(job, ["x" * 10_000])
    lines = progress.read_log(job)
    assert len(lines) == LOG_LINES
    assert lines[0] == "line 6"
    assert lines[-1] == "x" * LINE_LENGTH
    assert progress.read_log("nowhere") == []


def test_a_job_that_was_deleted_gets_no_log_back(records, progress, client, running):
    job = running[0].id
    progress.log(job, ["begins"])
    records.delete(job)
    progress.log(job, ["segmentation begins"])
    assert not client.exists(f"matphys:log:{job}")


def test_what_is_logged_stays_on_its_line(progress, running):
    job = running[0].id
    progress.log(job, ["a file called a.mp4\r\n2026-11-21T16:00:00Z published", "next"])
    assert progress.read_log(job) == ["a file called a.mp4 2026-11-21T16:00:00Z published", "next"]


def test_a_wait_without_events_takes_its_time(progress, monkeypatch, records, errand):
    monkeypatch.setattr(module, "BLOCK_S", 0.3)
    record = errand()
    records.create(record)
    following = progress.follow(record.id)
    next(following)
    began = time.monotonic()
    assert next(following) is None
    assert time.monotonic() - began >= 0.25
