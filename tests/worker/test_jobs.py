"""One attempt, in this process: what every end means for the job."""

import errno
import resource
import signal
import time

import cv2
import numpy as np
import pytest
import torch
from pydantic import BaseModel
from redis.exceptions import ConnectionError as RedisAway

from model.errors import InputError
from worker import jobs
from worker.jobs import AGAIN, CRASHED, DONE, Place
from worker.kinds import Kind, Outcome, Postponed
from worker.storage import StorageError


class NoOptions(BaseModel):
    pass


class Whatever(Kind):
    """Does what the test says: a kind of job is one small class."""

    name, queue, options, limit_s, memory_bytes = "whatever", "twins", NoOptions, 5.0, 1 << 30

    def __init__(self, does):
        self.does = does

    def run(self, run):
        return self.does(run) or Outcome()


@pytest.fixture
def attempt(redis_server, client, records, storage, errand, tmp_path):
    """Makes one attempt at a job of a kind that does what it is told; gives exit code and record."""

    def make(does, *, before=lambda record: None, **fields):
        fields.setdefault("kind", "whatever")
        record = errand(**fields)
        records.create(record)
        number = records.begin(record.id, "token", "w")
        folder = tmp_path / f"{record.id}-{number}"
        folder.mkdir()
        place = Place(redis_server.url, f"file://{tmp_path}/store", webhooks_to_private=True)
        kind = Whatever(does) if callable(does) else does
        before(record)
        code = jobs.run(records.get(record.id), number, kind, folder, place)
        return code, records.get(record.id)

    return make


def raising(error):
    def do(run):
        raise error

    return do


def test_results_are_published_under_their_attempt(attempt, storage, progress):
    def do(run):
        run.report("walking", 0.25)
        run.log("a word")
        (run.folder / "a.txt").write_text(run.inputs["note"].read_text() + "!")
        return Outcome((run.folder / "a.txt",), {"points": 7})

    def store(record):
        path = storage._folder / "note"
        path.write_text("note")
        storage.publish("jobs/n/input/note.json", path)
        path.unlink()

    code, record = attempt(do, before=store, inputs={"note": "jobs/n/input/note.json"})
    assert (code, record.status, record.metrics) == (DONE, "succeeded", {"points": 7})
    assert record.file("a.txt").key == f"jobs/{record.id}/1/a.txt"
    assert b"".join(storage.stream(record.file("a.txt").key)) == b"note!"
    stages = [event.stage for event in progress.read(record.id)]
    assert stages == ["", "starting", "walking", "publishing", "done"]
    words = [line.partition(" ")[2] for line in progress.read_log(record.id)]
    assert words == ["walking begins", "a word", "publishing begins"]


def test_bad_input_is_final_and_its_line_tells_no_path(attempt, tmp_path):
    code, record = attempt(lambda run: raising(InputError(f"{run.folder}/input/clip.mp4: no video"))(run))
    assert (code, record.status, record.error.type) == (DONE, "failed", "bad-input")
    assert record.error.detail == "input/clip.mp4: no video"


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (RuntimeError("/etc/secret"), CRASHED),
        (StorageError("full"), AGAIN),
        (OSError(errno.ENOSPC, "full"), AGAIN),
        (OSError(errno.EACCES, "no"), CRASHED),
        (RedisAway("away"), AGAIN),
    ],
)
def test_what_is_not_the_jobs_fault_leaves_the_job_to_its_worker(attempt, error, code):
    ended, record = attempt(raising(error))
    assert ended == code
    assert record.status == "running"
    assert record.error is None


def test_a_postponed_job_waits(attempt, records):
    code, record = attempt(raising(Postponed(30.0)))
    assert (code, record.status, record.crashes, record.postponed) == (DONE, "queued", 0, 1)
    assert records.due("twins") == []


def test_too_much_memory_is_the_end_of_the_job_alone(attempt):
    before = resource.getrlimit(resource.RLIMIT_AS)
    code, record = attempt(lambda run: bytearray(2 << 30))
    assert (code, record.status, record.error) == (DONE, "failed", jobs.TOO_LARGE)
    assert resource.getrlimit(resource.RLIMIT_AS) == before


@pytest.mark.parametrize(
    "exhaust",
    [lambda: torch.zeros(1 << 29), lambda: cv2.resize(np.zeros((9, 9), np.uint8), (60_000, 60_000))],
)
def test_too_much_memory_is_known_in_the_words_of_libraries(attempt, exhaust):
    code, record = attempt(lambda run: exhaust())
    assert (code, record.status, record.error) == (DONE, "failed", jobs.TOO_LARGE)


def test_too_much_time_is_the_end_of_the_job(attempt):
    kind = Whatever(lambda run: time.sleep(30))
    kind.limit_s = 0.2
    began = time.monotonic()
    code, record = attempt(kind)
    assert (code, record.status, record.error) == (DONE, "failed", jobs.TOO_SLOW)
    assert time.monotonic() - began < 5
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_a_handler_of_everything_does_not_swallow_the_limit(attempt):
    def do(run):
        try:
            time.sleep(30)
        except Exception:
            return None

    kind = Whatever(do)
    kind.limit_s = 0.2
    assert attempt(kind)[1].error == jobs.TOO_SLOW


def test_waiting_for_redis_does_not_count(attempt, monkeypatch):
    def slow(self, *arguments):
        time.sleep(0.3)

    monkeypatch.setattr(jobs.Records, "advance", slow)
    kind = Whatever(lambda run: [run.report(f"stage {number}", 0.1) for number in range(4)] and None)
    kind.limit_s = 0.6
    assert attempt(kind)[1].status == "succeeded"


def test_a_run_without_its_job_ends_and_publishes_nothing(attempt, records, storage):
    def do(run):
        records.cancel(run.record.id)
        run.report("walking", 0.5)
        pytest.fail("it went on")

    code, record = attempt(do)
    assert (code, record.status, record.files) == (DONE, "canceled", ())
    assert storage.list() == []


def test_a_run_that_lost_its_job_at_the_last_moment_publishes_nothing(attempt, records):
    def do(run):
        records.hand_back(run.record.id, 1)
        (run.folder / "a").write_text("a")
        return Outcome((run.folder / "a",))

    code, record = attempt(do)
    assert (code, record.status, record.files) == (DONE, "queued", ())


def test_progress_is_not_told_more_often_than_anyone_could_read(attempt, progress):
    def do(run):
        for step in range(1000):
            run.report("walking", step / 1000)

    _, record = attempt(do)
    assert sum(event.stage == "walking" for event in progress.read(record.id)) <= 3


def test_the_files_of_a_parent_are_fetched(attempt, records, storage, tmp_path):
    _, parent = attempt(lambda run: (run.folder / "x").write_text("content") and Outcome((run.folder / "x",)))
    seen = []
    _, record = attempt(lambda run: seen.append(run.fetch(run.parent, "x").read_text()), parent=parent.id)
    assert (record.status, seen) == ("succeeded", ["content"])
    _, record = attempt(lambda run: run.fetch(run.parent, "y"), parent=parent.id)
    assert record.error.detail == "y is gone: make it again"


def test_the_model_is_reached_by_name(attempt):
    seen = []
    attempt(lambda run: seen.append(run.model("version").__version__))
    assert seen
