import re
from datetime import UTC, datetime

from worker.queues import ALL_QUEUES, WorkerState


def test_alive_without_a_key(serving):
    import httpx

    assert httpx.get(f"{serving.url}/livez").json() == {"status": "ok"}


def test_not_ready_without_workers(http):
    answer = http.get("/readyz")
    assert answer.status_code == 503
    assert answer.headers["Content-Type"] == "application/problem+json"
    assert answer.json()["checks"] == {"redis": "ok", "store": "ok", "disk": "ok", "workers": "none alive"}


def working(*queues: str) -> WorkerState:
    return WorkerState("one", "idle", datetime.now(UTC), queues)


def test_ready_with_a_worker(serving, http, monkeypatch):
    monkeypatch.setattr("worker.queues.Queues.workers", lambda self: [working(*ALL_QUEUES)])
    assert http.get("/readyz").json()["status"] == "ok"


def test_not_ready_where_nobody_makes_twins(serving, http, monkeypatch):
    monkeypatch.setattr(
        "worker.queues.Queues.workers", lambda self: [working("webhooks"), working("exports")]
    )
    answer = http.get("/readyz")
    assert answer.status_code == 503
    assert answer.json()["checks"]["workers"] == "none alive for twins"


def test_not_ready_on_a_full_disk(serve, monkeypatch):
    monkeypatch.setattr("worker.queues.Queues.workers", lambda self: [working(*ALL_QUEUES)])
    serving = serve(min_free_mib=10**9)
    with serving.client() as http:
        assert http.get("/readyz").json()["checks"]["disk"] == "almost full"
        refused = http.post("/twins", content=b"x", headers={"Content-Type": "video/mp4"})
    assert refused.status_code == 503
    assert refused.json()["type"].endswith(":no-space")
    assert int(refused.headers["Retry-After"]) >= 1


def test_not_ready_when_the_store_cannot_be_written(serving, http, monkeypatch):
    monkeypatch.setattr("worker.storage.Storage.writable", lambda self: False)
    assert http.get("/readyz").json()["checks"]["store"] == "cannot be written"


def metric(text: str, name: str) -> float:
    found = re.search(rf"^{re.escape(name)} (\S+)$", text, re.MULTILINE)
    assert found, name
    return float(found[1])


def test_metrics_tell_of_queues_outcomes_stages_and_requests(serving, http, clip, tmp_path):
    done, _ = (
        http.post(f"/twins?parts={parts}", content=clip, headers={"Content-Type": "video/mp4"}).json()["id"]
        for parts in (1, 2)
    )
    serving.finish(done, {"bundle.twin.zip": b"x"}, tmp_path)
    http.get("/nothing/secret")
    answer = http.get("/metrics")
    assert answer.headers["Content-Type"].startswith("text/plain")
    text = answer.text
    assert metric(text, 'matphys_queue_depth{queue="twins"}') == 1
    assert metric(text, 'matphys_jobs_total{kind="twin",outcome="accepted"}') == 2
    assert metric(text, 'matphys_jobs_total{kind="twin",outcome="succeeded"}') == 1
    assert metric(text, 'matphys_stage_seconds_count{kind="twin",stage="total"}') == 1
    assert metric(text, 'matphys_stage_seconds_bucket{kind="twin",le="+Inf",stage="total"}') == 1
    assert metric(text, "matphys_upload_bytes_total") == 2 * len(clip)
    assert metric(text, "matphys_workers") == 0
    assert metric(text, "matphys_redis_up") == 1
    posted = 'matphys_http_request_seconds_count{method="POST",route="/twins",status="202"}'
    assert metric(text, posted) == 2
    assert "secret" not in text


def test_the_openapi_document_describes_every_route(http):
    document = http.get("/openapi.json").json()
    paths = document["paths"]
    assert {"/twins", "/twins/{id}", "/twins/{id}/events", "/twins/{id}/exports/{format}", "/livez"} <= set(
        paths
    )
    post = paths["/twins"]["post"]
    assert set(post["requestBody"]["content"]) == {
        "multipart/form-data",
        "application/octet-stream",
        "video/mp4",
    }
    assert {"size_m", "box", "Idempotency-Key"} <= {parameter["name"] for parameter in post["parameters"]}
    assert "application/problem+json" in post["responses"]["413"]["content"]
    properties = document["components"]["schemas"]["Job"]["properties"]
    assert all("examples" in properties[name] for name in ("id", "kind", "stage", "urls", "metrics"))
    assert "Last-Event-ID" in {each["name"] for each in paths["/twins/{id}/events"]["get"]["parameters"]}


def test_what_can_be_read_has_a_head(serving, http, clip):
    twin = http.post("/twins", content=clip, headers={"Content-Type": "video/mp4"}).headers["Location"]
    public = ("/", "/livez", "/metrics", "/openapi.json")
    for path in (*public, "/webhook-secret", "/twins", twin, f"{twin}/logs"):
        answer = http.head(path)
        assert answer.status_code == http.get(path).status_code == 200, path
        assert answer.content == b""
        assert "HEAD" in http.put(path).headers["Allow"], path
    assert http.head("/twins/nobody").status_code == 404
    assert http.head(f"{twin}/events").status_code == 405, "nobody follows a stream without a body"
