import os
import signal
import socket
import threading
import time

import pytest
import redis.exceptions

from worker import queues as queues_module
from worker.embedded import EmbeddedRedis
from worker.queues import ALL_QUEUES, Queues, connect
from worker.record import JobError
from worker.records import Records


def delivered(client, queue="twins"):
    return [name.rpartition("_")[0] for name in client.lrange(f"rq:queue:{queue}", 0, -1)]


def test_an_accepted_job_that_was_not_handed_over_is(client, records, queues, errand, eventually):
    record = errand()
    records.create(record)
    assert queues.reconcile() == 0, "it may still be on its way"
    eventually(lambda: queues.reconcile() == 1)
    assert queues.reconcile() == 0
    assert delivered(client) == [record.id]


def test_what_waits_at_rq_is_not_handed_over_again(client, records, queues, errand, monkeypatch):
    monkeypatch.setattr("worker.queues.SETTLED_S", 0.0)
    record = errand()
    queues.enqueue(records.create(record)[0])
    assert queues.reconcile() == 0
    assert delivered(client) == [record.id]


def test_a_job_handed_back_is_handed_over_again_when_its_time_has_come(
    client, records, queues, errand, monkeypatch, eventually
):
    monkeypatch.setattr("worker.queues.SETTLED_S", 0.0)
    record = errand()
    records.create(record)
    records.hand_back(record.id, records.begin(record.id, "t", "w"), 0.3)
    assert queues.reconcile() == 0
    eventually(lambda: queues.reconcile() == 1)


def test_positions_and_depths(records, queues, errand):
    first, second = errand(), errand()
    records.create(first)
    records.create(second)
    assert queues.depth() == {name: 2 if name == "twins" else 0 for name in ALL_QUEUES}
    assert queues.position(records.get(second.id)) == 1
    records.cancel(first.id)
    assert queues.position(records.get(first.id)) is None
    assert queues.position(records.get(second.id)) == 0


def test_a_canceled_job_leaves_the_queue(client, records, queues, errand):
    record = errand()
    queues.enqueue(records.create(record)[0])
    assert queues.cancel(record.id) == "queued"
    assert delivered(client) == []
    assert queues.cancel(record.id) == "canceled"
    assert queues.cancel("nowhere") is None
    assert client.keys("rq:job:*") == []


def test_nobody_works(queues):
    assert queues.workers() == []


def test_a_call_outlasts_a_killed_redis_and_nothing_is_lost(tmp_path, errand):
    with EmbeddedRedis(tmp_path / "redis") as server:
        client = connect(server.url, patience_s=30.0)
        records = Records(client)
        first = errand(digest="content")
        records.create(first, "key")
        os.kill(server.pid, signal.SIGKILL)
        answers = []
        second = errand(digest="other")
        thread = threading.Thread(target=lambda: answers.append(records.create(second)))
        thread.start()
        time.sleep(0.5)
        server.start()
        thread.join(20)
        assert answers[0][1]
        assert records.get(first.id).status == "queued"
        assert records.create(errand(digest="content"))[0].id == first.id, "content is still known"
        assert records.create(errand(digest="content"), "key")[0].id == first.id
        Queues(client, records).enqueue(answers[0][0])
        client.close()


def test_a_call_gives_up_when_patience_ends(tmp_path):
    client = connect(f"unix://{tmp_path}/nobody.sock", patience_s=0.1)
    began = time.monotonic()
    with pytest.raises(redis.exceptions.ConnectionError):
        client.ping()
    assert time.monotonic() - began < 5


def test_a_redis_that_hangs_is_given_up_too(monkeypatch):
    monkeypatch.setattr(queues_module, "ANSWER_S", 0.4)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        client = connect(f"redis://127.0.0.1:{silent.getsockname()[1]}", patience_s=1.0)
        began = time.monotonic()
        with pytest.raises(redis.exceptions.TimeoutError):
            client.get("a")
        assert 1.0 < time.monotonic() - began < 4.0


def test_a_redis_that_refuses_to_write_is_waited_for(records, client, errand, monkeypatch):
    """What Redis answers while its disk is full."""
    refusals = iter([True, True, False])
    plain = redis.Redis.execute_command

    def execute(self, *arguments, **options):
        if arguments[0] == "EVALSHA" and next(refusals, False):
            raise redis.exceptions.ResponseError(
                "MISCONF Errors writing to the AOF file: No space left on device"
            )
        return plain(self, *arguments, **options)

    monkeypatch.setattr(redis.Redis, "execute_command", execute)
    monkeypatch.setattr("worker.queues.REFUSED_S", 0.01)
    assert records.create(errand())[1]
    assert next(refusals, None) is None


def test_other_refusals_are_errors(client):
    with pytest.raises(redis.exceptions.ResponseError):
        client.execute_command("NO SUCH COMMAND")


def test_a_lost_job_is_taken_back_and_handed_over(records, queues, client, errand, monkeypatch, eventually):
    monkeypatch.setattr("worker.records.LEASE_S", 0.0)
    monkeypatch.setattr("worker.records.GRACE_S", 0.0)
    monkeypatch.setattr("worker.queues.SETTLED_S", 0.0)
    record = errand()
    records.create(record)
    records.begin(record.id, "t", "w")
    error = JobError(type="t", title="t", detail="d")
    records.reap(error)
    assert records.reap(error) == {record.id: "queued"}
    eventually(lambda: queues.reconcile() == 1)
    assert delivered(client) == [record.id]
