import os
import signal

import pytest

from worker.guard import Guard
from worker.janitor import Janitor, sweep, tidy
from worker.jobs import Place
from worker.storage import StorageError


@pytest.fixture
def stored(records, client, storage, errand, tmp_path):
    """Two jobs with a published file each."""
    made = []
    for keep_s in (1.0, 3600.0):
        record = errand(keep_s=keep_s)
        records.create(record)
        attempt = records.begin(record.id, "t", "w")
        (tmp_path / "x").write_text(record.id)
        records.succeed(
            record.id, attempt, [storage.publish(f"jobs/{record.id}/{attempt}/x", tmp_path / "x")], {}
        )
        made.append(record)
    return made


def test_jobs_and_files_whose_time_is_over_are_deleted_and_no_others(
    stored, records, client, storage, eventually
):
    over, lasting = stored
    sweep(records, storage)
    assert len(storage.list()) == 2
    eventually(lambda: (sweep(records, storage), records.get(over.id))[1] is None)
    client.zadd("matphys:garbage", {f"jobs/{over.id}/": 0})  # a zombie's time brought forward
    sweep(records, storage)
    assert storage.list() == [f"jobs/{lasting.id}/1/x"]
    assert records.get(lasting.id).file("x")
    assert records.garbage() == []


def test_what_cannot_be_deleted_does_not_keep_what_can(records, client, storage, tmp_path, monkeypatch):
    (tmp_path / "x").write_text("x")
    names = [f"jobs/{name}/" for name in ("held", "a", "b", "c")]
    for place, prefix in enumerate(names):
        storage.publish(f"{prefix}1/x", tmp_path / "x")
        client.zadd("matphys:garbage", {prefix: place})
    delete = storage.delete

    def kept(prefix):
        if "held" in prefix:
            raise StorageError("a legal hold")
        delete(prefix)

    monkeypatch.setattr(storage, "delete", kept)
    sweep(records, storage)
    assert storage.list() == ["jobs/held/1/x"]
    assert records.garbage() == ["jobs/held/"], "to be tried again"


def test_files_of_an_upload_without_a_job_are_deleted(records, client, storage, errand, tmp_path):
    record = errand()
    records.reserve(record.id)
    (tmp_path / "x").write_text("x")
    storage.publish(f"jobs/{record.id}/input/x", tmp_path / "x")
    sweep(records, storage)
    assert len(storage.list()) == 1, "it may still be claimed"
    client.zadd("matphys:garbage", {f"jobs/{record.id}/": 0})
    sweep(records, storage)
    assert storage.list() == []


def test_waiting_and_lost_jobs_are_handed_over(records, queues, client, errand, monkeypatch, eventually):
    monkeypatch.setattr("worker.records.LEASE_S", 0.0)
    monkeypatch.setattr("worker.records.GRACE_S", 0.0)
    monkeypatch.setattr("worker.queues.SETTLED_S", 0.0)
    waiting, lost = errand(), errand()
    records.create(waiting)
    records.create(lost)
    records.begin(lost.id, "t", "w")
    tidy(records, queues)
    tidy(records, queues)

    def delivered():
        tidy(records, queues)
        return client.llen("rq:queue:twins") == 2

    eventually(delivered)
    assert records.get(lost.id).crashes == 1


def test_it_is_started_again_when_it_was_killed(redis_server, records, errand, client, tmp_path, eventually):
    guard = Guard()
    janitor = Janitor("w", Place(redis_server.url, f"file://{tmp_path}/store"), guard)
    try:
        first = janitor._pid
        janitor.revive()
        assert janitor._pid == first
        os.kill(first, signal.SIGKILL)
        eventually(lambda: (janitor.revive(), janitor._pid)[1] != first)
        records.create(errand())
        eventually(lambda: client.llen("rq:queue:twins") == 1)
    finally:
        janitor.close()
        guard.close()
