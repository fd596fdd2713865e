"""Real workers over a real Redis; the jobs are errands (`benchmarks/faults/errand.py`)."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest
from standardwebhooks.webhooks import Webhook

from worker.main import main
from worker.storage import Storage
from worker.webhooks import secret_of


def horse_of(hands, worker):
    """The one child that leads a group, but no session."""
    for pid in hands.processes():
        try:
            with open(f"/proc/{pid}/stat") as file:
                fields = file.read().rpartition(")")[2].split()
        except FileNotFoundError:
            continue
        if int(fields[1]) == worker.pid and int(fields[2]) == pid != int(fields[3]):
            return pid
    return None


def test_a_worker_does_jobs_and_says_so(hands, queues, progress, eventually):
    worker = hands.start()
    job_id = hands.ask(seconds=0.2, bytes=1234)
    done = hands.ended(job_id)
    assert (done.status, done.attempt, done.files[0].bytes) == ("succeeded", 1, 1234)
    (state,) = queues.workers()
    assert state.queues == ("webhooks", "exports", "twins")
    assert [line.partition(" ")[2] for line in progress.read_log(job_id)] == [
        "attempt 1",
        "walking begins",
        "returning begins",
        "publishing begins",
    ]
    worker.send_signal(signal.SIGTERM)
    assert worker.wait(10) == 0
    assert queues.workers() == []
    lines = [json.loads(line) for line in hands.log.read_text().splitlines()]
    assert all(line["worker"].endswith(lines[0]["worker"].rpartition("-")[2]) for line in lines)
    stages = {line["stage"] for line in lines if line.get("job") == job_id and "stage" in line}
    assert stages == {"walking", "returning", "publishing"}
    assert [path.name for path in (hands.folder / "scratch").iterdir()] == ["lock"]


@pytest.mark.parametrize("trouble", ["exit", "segfault", "exception"])
def test_a_job_that_crashes_once_is_done_the_second_time(hands, trouble):
    hands.start()
    done = hands.ended(hands.ask(trouble=trouble, attempts=1))
    assert (done.status, done.attempt, done.crashes) == ("succeeded", 2, 1)


def test_a_job_that_always_crashes_fails_and_takes_no_other_with_it(hands):
    hands.start()
    bad, good = hands.ask(trouble="segfault"), hands.ask()
    failed = hands.ended(bad)
    assert (failed.status, failed.attempt, failed.error.type) == ("failed", 3, "crash")
    assert "/" not in failed.error.detail
    assert hands.ended(good).status == "succeeded"


@pytest.mark.parametrize(("trouble", "type_"), [("bad-input", "bad-input"), ("memory", "out-of-memory")])
def test_what_would_fail_again_is_not_tried_again(hands, trouble, type_):
    hands.start()
    failed = hands.ended(hands.ask(trouble=trouble))
    assert (failed.status, failed.attempt, failed.error.type) == ("failed", 1, type_)


@pytest.mark.parametrize("trouble", ["slow", "stuck"])
def test_a_job_has_only_so_much_time(hands, trouble):
    """Asleep in Python, and where no signal reaches it."""
    hands.start(limit_s=0.5, mercy_s=1.0)
    failed = hands.ended(hands.ask(trouble=trouble))
    assert (failed.status, failed.attempt, failed.error.type) == ("failed", 1, "timeout")


def test_a_running_job_is_canceled_within_seconds(hands, records, queues, eventually):
    worker = hands.start()
    job_id = hands.ask(seconds=8.0, company=True)
    hands.at_work(job_id)
    began = time.monotonic()
    assert queues.cancel(job_id) == "running"
    eventually(lambda: horse_of(hands, worker) is None)
    assert time.monotonic() - began < 4.0
    assert hands.ended(hands.ask()).status == "succeeded", "the worker goes on"
    assert records.get(job_id).status == "canceled"
    scratch = hands.folder / "scratch"
    # the next job's folder goes a moment after its status is known
    eventually(lambda: [path.name for path in scratch.glob("*/*")] == ["lock"])


def test_a_deleted_job_is_stopped_and_its_files_go(hands, records, client, eventually):
    worker = hands.start()
    done = hands.ended(hands.ask())
    running = hands.ask(seconds=8.0)
    hands.at_work(running)
    records.delete(running)
    records.delete(done.id)
    eventually(lambda: horse_of(hands, worker) is None)
    client.zadd("matphys:garbage", dict.fromkeys(client.zrange("matphys:garbage", 0, -1), 0))
    eventually(lambda: client.zcard("matphys:garbage") == 0, 20.0)
    assert Storage(hands.store_url).list() == []


def test_a_stopped_worker_finishes_within_the_grace(hands):
    worker = hands.start(grace_s=10.0)
    job_id = hands.ask(seconds=1.5)
    hands.at_work(job_id)
    worker.send_signal(signal.SIGTERM)
    assert worker.wait(10) == 0
    assert hands.ended(job_id, 0.1).attempt == 1


def test_a_stopped_worker_hands_back_what_it_cannot_finish(hands, records):
    worker = hands.start(grace_s=0.3)
    job_id = hands.ask(seconds=6.0, company=True)
    hands.at_work(job_id)
    worker.send_signal(signal.SIGTERM)
    assert worker.wait(10) == 0
    handed_back = records.get(job_id)
    assert (handed_back.status, handed_back.crashes) == ("queued", 0)
    assert hands.processes() == []


def test_a_second_signal_stops_it_at_once(hands, records):
    worker = hands.start(grace_s=60.0)
    job_id = hands.ask(seconds=8.0)
    hands.at_work(job_id)
    worker.send_signal(signal.SIGTERM)
    time.sleep(1.2)  # rq takes two signals within a second for one
    worker.send_signal(signal.SIGTERM)
    worker.wait(5)
    assert records.get(job_id).status == "queued"


def test_a_signal_to_all_processes_stops_no_job(hands, records):
    """As a service manager sends it."""
    worker = hands.start(grace_s=10.0)
    job_id = hands.ask(seconds=1.0)
    hands.at_work(job_id)
    for pid in hands.processes():
        os.kill(pid, signal.SIGTERM)
    assert worker.wait(10) == 0
    assert hands.ended(job_id, 0.1).attempt == 1


def test_a_killed_worker_leaves_no_process_and_its_successor_takes_up_its_job(hands, records, eventually):
    worker = hands.start()
    job_id = hands.ask(seconds=2.0, company=True)
    hands.at_work(job_id)
    worker.kill()
    worker.wait()
    eventually(lambda: hands.processes() == [])
    hands.start()
    done = hands.ended(job_id)
    assert (done.status, done.attempt, done.crashes) == ("succeeded", 2, 1)
    assert len(list((hands.folder / "scratch").iterdir())) == 2, (
        "the lock, and the folder of the living worker"
    )


@pytest.mark.slow
def test_the_job_of_a_worker_that_never_comes_back_goes_to_another(hands, records):
    """On another machine nothing is known of it but that it is silent."""
    worker = hands.start()
    job_id = hands.ask(seconds=1.0)
    hands.at_work(job_id)
    worker.kill()
    worker.wait()
    (hands.folder / "scratch").rename(hands.folder / "elsewhere")
    hands.start()
    done = hands.ended(job_id, 30.0)
    assert (done.status, done.attempt) == ("succeeded", 2)


def test_a_postponed_job_is_not_to_blame(hands):
    hands.start()
    done = hands.ended(hands.ask(trouble="later", attempts=2))
    assert (done.status, done.attempt, done.crashes, done.postponed) == ("succeeded", 3, 0, 2)


def test_a_kind_of_job_that_is_unknown_here_is_left_for_others(hands, records, errand, queues):
    hands.start()
    strange = errand(kind="unheard-of")
    queues.enqueue(records.create(strange)[0])
    assert hands.ended(hands.ask()).status == "succeeded"
    assert (records.get(strange.id).status, records.get(strange.id).attempt) == ("queued", 0)


def test_two_workers_share_the_work(hands, records):
    hands.start()
    hands.start()
    ids = [hands.ask(seconds=0.3) for _ in range(8)]
    done = [hands.ended(job_id) for job_id in ids]
    assert {record.status for record in done} == {"succeeded"}
    assert {record.attempt for record in done} == {1}
    begun = [json.loads(line) for line in hands.log.read_text().splitlines() if '"attempt begins"' in line]
    assert len({line["worker"] for line in begun}) == 2


def test_the_end_is_told_by_a_signed_webhook(hands, client):
    got = []

    class Receiver(BaseHTTPRequestHandler):
        def do_POST(self):
            body = self.rfile.read(int(self.headers["Content-Length"]))
            got.append((dict(self.headers), body))
            self.send_response(200)
            self.send_header("Content-Length", "0")
            self.end_headers()

        def log_message(self, *arguments):
            pass

    server = HTTPServer(("127.0.0.1", 0), Receiver)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        hands.start()
        job_id = hands.ask(webhook=f"http://127.0.0.1:{server.server_port}/")
        hands.ended(job_id)
        hands.ended(f"{job_id}-webhook")
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
    ((headers, body),) = got
    told = Webhook(secret_of(client, "a")).verify(body, headers)
    assert told["type"] == "errand.succeeded"
    assert told["data"]["id"] == job_id


def test_a_scratch_folder_of_somebody_else_is_refused(tmp_path):
    (tmp_path / "own").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "own")
    place = ["--redis-url", "unix:///x", "--store-url", f"file://{tmp_path}"]
    command = [sys.executable, "-m", "worker.main", *place, "--scratch", str(tmp_path / "link")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "belongs to somebody else: give another --scratch" in done.stderr


def test_wrong_settings_are_one_line(capsys, tmp_path):
    assert main(["--store-url", "file:///x"]) == 2
    assert "redis-url" in capsys.readouterr().err
    assert main(["--redis-url", "unix:///x", "--store-url", "ftp://x"]) == 2
    assert capsys.readouterr().err.startswith("matphys-worker: ftp://x: expected file:///FOLDER or s3://")
    assert main(["--redis-url", "unix:///x", "--store-url", f"file://{tmp_path}", "--queues", "x"]) == 2
    assert capsys.readouterr().err == "matphys-worker: --queues x: choose from webhooks, exports, twins\n"
