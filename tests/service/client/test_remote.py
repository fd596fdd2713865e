import json

import pytest

from service.client import ServiceError

FILE = {"name": "bundle.twin.zip", "bytes": 3, "sha256": "0" * 64, "url": "/twins/a1/files/bundle.twin.zip"}


def event(number, status="running", stage="tracking", progress=10.0):
    data = json.dumps({"status": status, "stage": stage, "progress": progress})
    return f"id: {number}\nevent: progress\ndata: {data}\n\n"


@pytest.fixture
def twin(client, service):
    service.job()
    return client.twin("a1")


def test_waiting_reports_every_change_once(twin, service):
    service.job().events(
        event(1), ": ping\n\n", event(2), event(3, progress=60.0), event(4, "succeeded", "done", 100.0)
    )
    service.job(status="succeeded", progress=100.0, files=[FILE])
    seen = []
    job = twin.wait(lambda job: seen.append((job.status, job.progress)))
    assert seen == [("queued", 0), ("running", 10), ("running", 60), ("succeeded", 100)]
    assert job.files[0].name == "bundle.twin.zip"


def test_events_are_resumed_where_they_broke_off(twin, service):
    service.job().events(event(1), event(2, progress=20.0), 'id: 3\ndata: {"stat', broken=True).job(
        status="running", stage="tracking", progress=20.0
    )
    service.events(event(3, "succeeded", "done", 100.0)).job(status="succeeded")
    assert twin.wait().status == "succeeded"
    streams = [request for request in service.asked if request.url.path.endswith("/events")]
    assert [request.headers.get("Last-Event-ID") for request in streams] == [None, "2"]


def test_where_no_events_come_the_job_is_asked_for(twin, service, client):
    service.job().then(503, headers={"Retry-After": "3"}, json={}).job(status="running", progress=5.0)
    service.breaks().job(status="running", progress=50.0).breaks().job(status="succeeded")
    seen = []
    twin.wait(lambda job: seen.append(job.progress))
    assert seen == [0, 5, 50, 0]
    assert client.slept[0] == 3


def test_a_failed_job_is_an_error_with_its_fields(twin, service):
    error = {
        "type": "urn:matphys:problem:bad-input",
        "title": "The input cannot be used",
        "detail": "clip: short",
    }
    service.job(status="failed", error=error)
    with pytest.raises(ServiceError, match="clip: short") as raised:
        twin.wait()
    assert (raised.value.type, raised.value.job_id, raised.value.status) == (error["type"], "a1", None)


def test_a_canceled_job_is_an_error(twin, service):
    service.job(status="canceled")
    with pytest.raises(ServiceError, match="canceled"):
        twin.wait()


def test_waiting_has_an_end(twin, service):
    service.job(status="running", progress=12.0).events(event(1))
    with pytest.raises(TimeoutError, match="a1 is running still, at 12 %"):
        twin.wait(timeout_s=0)


def test_deleting_what_is_gone_is_no_error(twin, service):
    service.then(204).then(404, json={"type": "x", "title": "Not found", "status": 404})
    twin.delete()
    twin.delete()
    assert [request.method for request in service.asked[1:]] == ["DELETE", "DELETE"]


def test_canceling_is_tried_again(twin, service):
    service.breaks().job(status="canceled")
    assert twin.cancel().status == "canceled"


def test_the_log_is_text(twin, service):
    service.then(text="one\ntwo\n")
    assert twin.logs() == "one\ntwo\n"


def test_an_export_is_asked_for_until_it_is_made(twin, service, client, tmp_path):
    for _ in range(2):
        service.then(202, headers={"Retry-After": "2"}, json={})
    service.then(content=b"ply")
    assert twin.export("ply", tmp_path / "twin.ply").read_bytes() == b"ply"
    assert client.slept == [2, 2]
    assert service.asked[-1].url.path == "/twins/a1/exports/ply"


def test_further_kinds_of_job_are_started_and_listed(twin, service, clip_path):
    service.job(id="d1", kind="diagnosis").then(json={"items": [], "next_cursor": None})
    assert twin.start("diagnoses", {"observation": clip_path}).id == "d1"
    assert list(twin.started("diagnoses")) == []
    assert [request.url.path for request in service.asked[1:]] == ["/twins/a1/diagnoses"] * 2


def test_a_file_that_is_not_there_is_named(twin, tmp_path):
    with pytest.raises(ServiceError, match=r"report\.html: the job has none yet"):
        twin.download("report.html", tmp_path / "x")


def test_strange_events_are_passed_over(twin, service):
    service.job().events("data: [1]\n\n", "data: nonsense\n\n", event(1, "succeeded")).job(status="succeeded")
    assert twin.wait().status == "succeeded"


def test_a_gateway_that_is_away_while_waiting_costs_nothing(twin, service):
    service.job().then(502, text="bad gateway").breaks().then(504, text="").job(status="succeeded")
    assert twin.wait().status == "succeeded"
