import json
import threading
import time

import httpx
import pytest

FINISHED = {"bundle.twin.zip": b"0123456789", "preview.mp4": b"moving", "twin.json": b"{}"}


@pytest.fixture
def twin(http, clip) -> str:
    answer = http.post("/twins", content=clip, headers={"Content-Type": "video/mp4"})
    return answer.json()["id"]


def problem(answer, status):
    assert answer.status_code == status, answer.text
    assert answer.headers["Content-Type"] == "application/problem+json"
    content = answer.json()
    assert content["status"] == status
    assert content["type"].startswith("urn:matphys:problem:")
    assert content["instance"] == f"urn:uuid:{answer.headers['X-Request-ID']}"
    return content


def test_a_twin_that_is_done_names_its_files(serving, http, twin, tmp_path):
    serving.finish(twin, FINISHED, tmp_path, {"silhouette_iou": 0.9})
    job = http.get(f"/twins/{twin}").json()
    assert job["status"] == "succeeded"
    assert job["progress"] == 100
    assert job["queue_position"] is None
    assert job["metrics"] == {"silhouette_iou": 0.9}
    assert job["expires_at"] > job["completed_at"] > job["started_at"] >= job["created_at"]
    assert {file["name"] for file in job["files"]} == set(FINISHED)
    for file in job["files"]:
        assert http.get(file["url"]).content == FINISHED[file["name"]]
        assert file["bytes"] == len(FINISHED[file["name"]])
    assert job["created_at"].endswith("Z")


def test_results_are_kept_as_long_as_the_operator_says(serve, clip, tmp_path):
    serving = serve(retention_hours=1.0)
    with serving.client() as http:
        twin = http.post("/twins", content=clip, headers={"Content-Type": "video/mp4"}).json()["id"]
        record = serving.finish(twin, FINISHED, tmp_path)
    assert (record.expires_at - record.completed_at).total_seconds() == pytest.approx(3600)


def test_the_list_is_paged_newest_first(serving, http, clip):
    ids = [
        http.post(f"/twins?parts={parts}", content=clip, headers={"Content-Type": "video/mp4"}).json()["id"]
        for parts in (1, 2, 3)
    ]
    first = http.get("/twins", params={"limit": 2}).json()
    assert [job["id"] for job in first["items"]] == ids[:0:-1]
    rest = http.get("/twins", params={"limit": 2, "cursor": first["next_cursor"]}).json()
    assert [job["id"] for job in rest["items"]] == ids[:1]
    assert rest["next_cursor"] is None
    http.post(f"/twins/{ids[1]}/cancel")
    canceled = http.get("/twins", params={"status": "canceled"}).json()["items"]
    assert [job["id"] for job in canceled] == [ids[1]]


@pytest.mark.parametrize("cursor", ["x", "a" * 43, "é", "AAAA", "' OR 1=1"])
def test_a_cursor_that_is_none_of_ours_is_refused(http, cursor):
    problem(http.get("/twins", params={"cursor": cursor}), 422)


def test_tenants_see_nothing_of_each_other(serving, http, twin, tmp_path):
    serving.finish(twin, FINISHED, tmp_path)
    with serving.client("other", ("submit", "read")) as other:
        assert other.get("/twins").json()["items"] == []
        unknown = other.get(f"/twins/{'0' * 32}").json()
        for method, path in (
            ("GET", ""),
            ("GET", "/events"),
            ("GET", "/logs"),
            ("GET", "/files/bundle.twin.zip"),
            ("GET", "/exports/ply"),
            ("POST", "/cancel"),
            ("DELETE", ""),
        ):
            content = problem(other.request(method, f"/twins/{twin}{path}"), 404)
            assert content["detail"] == unknown["detail"]
    assert http.get(f"/twins/{twin}").json()["status"] == "succeeded"


def test_an_admin_sees_all_tenants(serving, twin):
    with serving.client("operators", ("admin",)) as admin:
        assert admin.get(f"/twins/{twin}").status_code == 200


@pytest.mark.parametrize("job_id", ["x", "0" * 32, "..", "%2e%2e", "0" * 64, "a%00b", "é", "*"])
def test_a_twin_that_is_not_there_is_not_found(http, job_id):
    problem(http.get(f"/twins/{job_id}/logs"), 404)


def test_a_file_that_is_not_there_is_not_found(serving, http, twin, tmp_path):
    serving.finish(twin, FINISHED, tmp_path)
    for name in ("other.zip", "..%2f..%2fetc%2fpasswd", "%2e%2e", "input", "twin.json%00"):
        problem(http.get(f"/twins/{twin}/files/{name}"), 404)


def test_a_canceled_twin_stays_canceled(serving, http, twin):
    assert http.post(f"/twins/{twin}/cancel").json()["status"] == "canceled"
    assert http.post(f"/twins/{twin}/cancel").json()["status"] == "canceled"
    assert serving.records.begin(twin, "token", "worker") is None


def test_what_is_done_cannot_be_canceled(serving, http, twin, tmp_path):
    serving.finish(twin, FINISHED, tmp_path)
    problem(http.post(f"/twins/{twin}/cancel"), 409)
    assert http.get(f"/twins/{twin}").json()["status"] == "succeeded"


def test_a_deleted_twin_is_gone(serving, http, twin, tmp_path):
    serving.finish(twin, FINISHED, tmp_path)
    answer = http.delete(f"/twins/{twin}")
    assert answer.status_code == 204
    assert answer.content == b""
    problem(http.get(f"/twins/{twin}"), 404)
    problem(http.get(f"/twins/{twin}/files/bundle.twin.zip"), 404)
    problem(http.delete(f"/twins/{twin}"), 404)
    assert http.get("/twins").json()["items"] == []


def test_a_running_twin_that_is_deleted_loses_its_attempt(serving, http, twin):
    attempt = serving.records.begin(twin, "token", "worker")
    assert http.delete(f"/twins/{twin}").status_code == 204
    assert not serving.records.renew(twin, attempt)


def test_the_log_is_text(serving, http, twin):
    from worker.progress import Progress
    from worker.queues import connect

    with connect(serving.settings.redis_url) as client:
        Progress(client).log(twin, ["tracking: 300 points", "<b>bold</b>"])
    answer = http.get(f"/twins/{twin}/logs")
    assert answer.headers["Content-Type"] == "text/plain; charset=utf-8"
    assert answer.text == "tracking: 300 points\n<b>bold</b>\n"


def events(answer: httpx.Response) -> list[dict]:
    found, event = [], {}
    for line in answer.iter_lines():
        if line.startswith(":"):
            continue
        if line:
            name, _, value = line.partition(": ")
            event[name] = value
        elif event:
            found.append(event | {"data": json.loads(event["data"])})
            event = {}
    return found


def test_events_follow_a_job_to_its_end(serving, http, twin, tmp_path):
    worker = threading.Timer(0.3, serving.finish, (twin, FINISHED, tmp_path))
    worker.start()
    with http.stream("GET", f"/twins/{twin}/events") as answer:
        assert answer.headers["Content-Type"].startswith("text/event-stream")
        found = events(answer)
    worker.join()
    assert found[0]["data"]["status"] == "queued"
    assert found[-1]["data"]["status"] == "succeeded"
    assert "simulation" in [event["data"]["stage"] for event in found]
    assert all(event["event"] == "progress" for event in found)


def test_events_resume_after_the_last_one_seen(serving, http, twin, tmp_path):
    serving.finish(twin, FINISHED, tmp_path)
    with http.stream("GET", f"/twins/{twin}/events") as answer:
        found = events(answer)
    with http.stream("GET", f"/twins/{twin}/events", headers={"Last-Event-ID": found[1]["id"]}) as answer:
        assert events(answer) == found[2:]


@pytest.mark.parametrize("last", ["x", "1-2-3", "$", "-1", "9" * 30, ""])
def test_a_last_event_that_is_none_is_refused(http, twin, last):
    problem(http.get(f"/twins/{twin}/events", headers={"Last-Event-ID": last}), 422)


def test_a_silent_stream_shows_that_it_lives(serving, http, twin, monkeypatch):
    monkeypatch.setattr("fastapi.routing._PING_INTERVAL", 0.2)
    with http.stream("GET", f"/twins/{twin}/events") as answer:
        lines = answer.iter_lines()
        assert any(line.startswith(":") for line in lines)


@pytest.mark.parametrize(
    ("scope", "method", "path"),
    [
        ("read", "POST", "/twins"),
        ("read", "DELETE", "/twins/x"),
        ("read", "POST", "/twins/x/cancel"),
        ("submit", "GET", "/twins"),
    ],
)
def test_a_key_without_the_scope_is_refused(serving, scope, method, path):
    with serving.client(scopes=(scope,)) as limited:
        answer = limited.request(method, path)
    problem(answer, 403)
    assert "insufficient_scope" in answer.headers["WWW-Authenticate"]


def test_errors_of_the_framework_are_problems_too(http):
    problem(http.get("/nothing"), 404)
    wrong_method = http.put("/twins")
    problem(wrong_method, 405)
    assert set(wrong_method.headers["Allow"].split(", ")) == {"GET", "HEAD", "POST"}
    problem(http.get("/twins", params={"limit": 0}), 422)
    problem(http.get("/twins/"), 404)


def test_every_answer_is_framed(http):
    for path in ("/livez", "/twins", "/nothing"):
        headers = http.get(path, headers={"Origin": "https://evil.example"}).headers
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["X-Frame-Options"] == "DENY"
        assert headers["Cache-Control"] == "no-store"
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert not any(name.startswith("access-control") for name in headers)


def test_a_redis_that_is_away_is_a_problem_that_says_when_to_come_back(serve, redis_server):
    serving = serve()
    with serving.client() as http:
        redis_server.stop()
        try:
            started = time.monotonic()
            answer = http.get("/twins")
            problem(answer, 503)
            assert int(answer.headers["Retry-After"]) >= 1
            assert time.monotonic() - started < 10
            assert http.get("/livez").status_code == 200
            assert problem(http.get("/readyz"), 503)["checks"]["redis"] != "ok"
            assert b"matphys_redis_up 0" in http.get("/metrics").content
        finally:
            redis_server.start()
        assert http.get("/twins").status_code == 200
