import hashlib
import time

import pytest

from service import submission


def submit(http, clip, **kwargs):
    answer = http.post(
        "/twins", content=clip, headers={"Content-Type": "video/mp4"} | kwargs.pop("headers", {}), **kwargs
    )
    assert answer.status_code == 202, answer.text
    return answer


def test_a_raw_clip_is_accepted_and_kept(serving, http, clip):
    answer = submit(http, clip, params={"size_m": "0.3", "box": "1,2,30,20"})
    job = answer.json()
    assert answer.headers["Location"] == f"/twins/{job['id']}"
    assert int(answer.headers["Retry-After"]) >= 1
    assert job["status"] == "queued"
    assert job["queue_position"] == 0
    assert job["options"]["size_m"] == 0.3
    assert job["options"]["box"] == [1, 2, 30, 20]
    record = serving.records.get(job["id"])
    assert b"".join(serving.storage.stream(record.inputs["video"])) == clip
    assert serving.staged() == []


def test_a_form_brings_files_and_options(serving, http, clip):
    camera = b'{"intrinsics": [[90, 0, 32], [0, 90, 24], [0, 0, 1]]}'
    answer = http.post(
        "/twins",
        files={"video": ("../../etc/passwd", clip, "text/html"), "camera": ("c", camera)},
        data={"parts": "3"},
    )
    assert answer.status_code == 202, answer.text
    record = serving.records.get(answer.json()["id"])
    assert record.options["parts"] == 3
    assert set(record.inputs) == {"video", "camera"}
    assert record.inputs["camera"].endswith("/input/camera.json")
    assert b"".join(serving.storage.stream(record.inputs["camera"])) == camera


def test_a_body_of_unknown_length_is_streamed(serving, http, clip):
    answer = http.post(
        "/twins", content=iter([clip[:100], clip[100:]]), headers={"Content-Type": "video/mp4"}
    )
    assert answer.status_code == 202
    (key,) = serving.stored()
    assert b"".join(serving.storage.stream(key)) == clip


def test_the_same_clip_and_options_are_one_twin(serving, http, clip):
    first, second = submit(http, clip).json(), submit(http, clip).json()
    other = submit(http, clip, params={"parts": 4}).json()
    assert first["id"] == second["id"] != other["id"]
    assert len(serving.stored()) == 2


def test_another_tenant_gets_a_twin_of_its_own(serving, http, clip):
    with serving.client("other") as other:
        assert submit(http, clip).json()["id"] != submit(other, clip).json()["id"]


def test_an_idempotency_key_gives_the_same_twin_and_refuses_another(serving, http, clip):
    headers = {"Idempotency-Key": "clip-1"}
    first = submit(http, clip, headers=headers).json()
    assert submit(http, clip, headers=headers).json()["id"] == first["id"]
    refused = http.post("/twins?parts=4", content=clip, headers={"Content-Type": "video/mp4"} | headers)
    assert refused.status_code == 422
    assert refused.json()["type"].endswith(":key-reused")
    assert len(serving.stored()) == 1


def test_an_idempotency_key_outlives_an_upgrade(serving, http, clip, monkeypatch):
    headers = {"Idempotency-Key": "clip-1"}
    first = submit(http, clip, headers=headers).json()
    monkeypatch.setattr(submission, "__version__", "999.0")
    assert submit(http, clip, headers=headers).json()["id"] == first["id"]
    assert submit(http, clip).json()["id"] != first["id"], "content alone is made anew by new software"


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ("parts=0", "parts"),
        ("parts=three", "parts"),
        ("size_m=nan", "size_m"),
        ("box=1,2,3", "box"),
        ("surprise=1", "surprise"),
        ("webhook=ftp://example.org", "webhook"),
        ("webhook=http://[/hook", "webhook"),
        ("webhook=http://example.org:99999/", "webhook"),
        ("webhook=https://user:word@example.org/", "webhook"),
        ("shape=cube", "shape"),
    ],
)
def test_an_option_that_is_none_is_named(serving, http, clip, query, field):
    answer = http.post(f"/twins?{query}", content=clip, headers={"Content-Type": "video/mp4"})
    assert answer.status_code == 422
    assert answer.headers["Content-Type"] == "application/problem+json"
    assert answer.json()["errors"][0]["field"] == field
    assert serving.stored() == []
    assert serving.staged() == []


def test_an_option_given_twice_is_refused(http, clip):
    answer = http.post("/twins?parts=3&parts=4", files={"video": clip})
    assert answer.status_code == 422
    assert "twice" in answer.json()["detail"]


def test_a_field_of_the_form_goes_before_the_query(http, clip):
    answer = http.post("/twins?parts=3&seed=1", files={"video": clip}, data={"parts": "4"})
    assert answer.json()["options"] | {"parts": 4, "seed": 1} == answer.json()["options"]


def test_a_form_without_a_clip_is_refused(http):
    answer = http.post("/twins", files={"camera": b'{"intrinsics": [[9, 0, 3], [0, 9, 2], [0, 0, 1]]}'})
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith("video is missing")


def test_a_full_queue_says_when_to_come_back(serve, clip):
    serving = serve(max_jobs=1)
    with serving.client() as http:
        submit(http, clip)
        answer = http.post("/twins?parts=4", content=clip, headers={"Content-Type": "video/mp4"})
    assert answer.status_code == 503
    assert int(answer.headers["Retry-After"]) > 1
    assert len(serving.stored()) == 1


def test_a_tenant_with_too_many_jobs_says_when_to_come_back(serve, clip):
    serving = serve(max_jobs_per_tenant=1)
    with serving.client() as http, serving.client("other") as other:
        submit(http, clip)
        answer = http.post("/twins?parts=4", content=clip, headers={"Content-Type": "video/mp4"})
        submit(other, clip)
    assert answer.status_code == 429
    assert int(answer.headers["Retry-After"]) > 1
    assert len(serving.stored()) == 2


def test_submissions_too_fast_are_refused(serve, clip):
    serving = serve(submissions_per_minute=2)
    with serving.client() as http, serving.client("other") as other:
        submit(http, clip)
        submit(http, clip)
        answer = http.post("/twins", content=clip, headers={"Content-Type": "video/mp4"})
        assert answer.status_code == 429
        assert 1 <= int(answer.headers["Retry-After"]) <= 61
        assert http.get("/twins").status_code == 200
        submit(other, clip)


def test_an_export_is_made_when_asked_for(serving, http, clip, tmp_path):
    twin = submit(http, clip).json()["id"]
    assert http.get(f"/twins/{twin}/exports/ply").status_code == 409
    serving.finish(twin, {"bundle.twin.zip": b"bundle"}, tmp_path)
    url = f"/twins/{twin}/exports/ply"
    asked = http.get(url)
    assert asked.status_code == 202
    assert int(asked.headers["Retry-After"]) >= 1
    export = asked.json()
    assert export["kind"] == "export"
    assert export["parent"] == twin
    assert export["urls"] == {"self": url}
    assert asked.headers["Location"] == url
    assert http.get(url).json()["id"] == export["id"]
    serving.finish(export["id"], {"twin.ply": b"ply"}, tmp_path)
    made = http.get(url)
    assert made.status_code == 200
    assert made.content == b"ply"
    assert made.headers["ETag"] == f'"{hashlib.sha256(b"ply").hexdigest()}"'
    assert http.get(f"/twins/{export['id']}").status_code == 404


def test_an_export_nobody_knows_is_not_found(serving, http, clip, tmp_path):
    twin = submit(http, clip).json()["id"]
    serving.finish(twin, {"bundle.twin.zip": b"bundle"}, tmp_path)
    answer = http.get(f"/twins/{twin}/exports/doc")
    assert answer.status_code == 404
    assert "ply" in answer.json()["detail"]


def test_an_export_that_failed_says_why_and_may_be_tried_again_later(
    serving, http, clip, tmp_path, monkeypatch
):
    from worker.record import JobError

    twin = submit(http, clip).json()["id"]
    serving.finish(twin, {"bundle.twin.zip": b"bundle"}, tmp_path)
    first = http.get(f"/twins/{twin}/exports/ply").json()["id"]
    attempt = serving.records.begin(first, "token", "worker")
    serving.records.fail(
        first, attempt, JobError(type="bad-input", title="No", detail="the twin has no points")
    )
    answer = http.get(f"/twins/{twin}/exports/ply")
    assert answer.status_code == 422
    assert answer.json()["detail"] == "the twin has no points"
    monkeypatch.setattr("service.routes.twins.TRY_AGAIN_SECONDS", 0.0)
    time.sleep(0.01)
    assert http.get(f"/twins/{twin}/exports/ply").json()["id"] != first
