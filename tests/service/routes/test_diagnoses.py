from pathlib import Path

import pytest

VIDEO = {"Content-Type": "video/mp4"}


@pytest.fixture
def twin(serving, http, clip, tmp_path) -> str:
    twin = http.post("/twins", content=clip, headers=VIDEO).json()["id"]
    serving.finish(twin, {"bundle.twin.zip": b"bundle"}, tmp_path)
    return twin


def test_an_observation_is_taken_and_its_report_given(serving, http, twin, observation, tmp_path):
    answer = http.post(f"/twins/{twin}/diagnoses", content=observation)
    assert answer.status_code == 202, answer.text
    job = answer.json()
    assert answer.headers["Location"] == f"/diagnoses/{job['id']}"
    assert (job["kind"], job["parent"]) == ("diagnosis", twin)
    assert [each["id"] for each in http.get(f"/twins/{twin}/diagnoses").json()["items"]] == [job["id"]]
    files = {"report.json": b'{"verdict": {}}', "report.html": b"<h1>Wind</h1>"}
    serving.finish(job["id"], files, tmp_path, {"effect": "wind", "probability": 0.9})
    done = http.get(f"/diagnoses/{job['id']}").json()
    assert done["status"] == "succeeded"
    assert done["metrics"] == {"effect": "wind", "probability": 0.9}
    assert {file["name"] for file in done["files"]} == set(files)
    page = http.get(f"/diagnoses/{job['id']}/files/report.html")
    assert page.content == files["report.html"]
    assert page.headers["Content-Disposition"].startswith("attachment")


@pytest.mark.parametrize("media_type", ["video/mp4", "application/mp4"])
def test_a_video_is_taken_in_its_place(serving, http, twin, clip, media_type):
    answer = http.post(f"/twins/{twin}/diagnoses", content=clip, headers={"Content-Type": media_type})
    assert answer.status_code == 202, answer.text
    assert set(serving.records.get(answer.json()["id"]).inputs) == {"video"}


def test_how_a_video_is_looked_at_says_nothing_of_an_observation(http, twin, observation):
    asked = {"files": {"observation": observation}, "data": {"tracking": "cotracker"}}
    answer = http.post(f"/twins/{twin}/diagnoses", **asked)
    assert answer.status_code == 422
    assert answer.json()["detail"] == "tracking is about a video, and none is there"
    usual = {"files": {"observation": observation}, "data": {"tracking": "opencv"}}
    assert http.post(f"/twins/{twin}/diagnoses", **usual).status_code == 202


def test_a_second_interaction_and_options_come_in_a_form(serving, http, twin, observation, clip):
    files = {"video": clip, "transfer": observation}
    answer = http.post(f"/twins/{twin}/diagnoses", files=files, data={"tracking": "cotracker"})
    assert answer.status_code == 202, answer.text
    job = answer.json()
    assert job["options"]["tracking"] == "cotracker"
    record = serving.records.get(job["id"])
    assert set(record.inputs) == {"video", "transfer"}
    assert [Path(key).suffix for key in sorted(record.inputs.values())] == [".npz", ".mp4"]


def test_the_same_request_gives_the_same_job(http, twin, observation):
    ask = {"content": observation, "headers": {"Idempotency-Key": "seen-1"}}
    first, second = (http.post(f"/twins/{twin}/diagnoses", **ask).json()["id"] for _ in range(2))
    assert first == second


def test_those_of_a_twin_come_in_pages_and_by_status(http, twin, observation, clip):
    path = f"/twins/{twin}/diagnoses"
    asked = [
        http.post(path, content=observation),
        http.post(path, content=clip, headers={"Content-Type": "video/mp4"}),
    ]
    ids = sorted((one.json()["id"] for one in asked), reverse=True)
    first = http.get(path, params={"limit": 1}).json()
    second = http.get(path, params={"limit": 1, "cursor": first["next_cursor"]}).json()
    assert [page["items"][0]["id"] for page in (first, second)] == ids
    assert second["next_cursor"] is None
    assert http.get(path, params={"status": "succeeded"}).json()["items"] == []
    assert len(http.get(path, params={"status": "queued"}).json()["items"]) == 2


def test_neither_is_refused(http, twin, observation):
    answer = http.post(f"/twins/{twin}/diagnoses", files={"transfer": observation})
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith("observation is missing")


@pytest.mark.parametrize(
    ("names", "line"),
    [
        (("observation", "video"), "observation and video are there: send one of them"),
        (("observation", "mask"), "mask is there without video: send both"),
    ],
)
def test_what_would_be_ignored_is_refused(http, twin, observation, clip, names, line):
    files = {name: observation if name == "observation" else clip for name in names}
    answer = http.post(f"/twins/{twin}/diagnoses", files=files)
    assert answer.status_code == 422
    assert answer.json()["detail"] == line


@pytest.mark.parametrize(
    ("damage", "status", "line"),
    [
        (lambda seen: b"text", 415, "not a NPZ file"),
        (lambda seen: seen[:400], 422, "zip archive"),
        (lambda seen: b"", 422, "empty"),
    ],
)
def test_what_is_no_observation_is_refused(http, twin, observation, damage, status, line):
    answer = http.post(f"/twins/{twin}/diagnoses", content=damage(observation))
    assert answer.status_code == status, answer.text
    assert line in answer.json()["detail"]


def test_one_that_breaks_its_contract_is_refused_by_key(http, twin, serving):
    import io

    import numpy as np

    target = io.BytesIO()
    np.savez(target, times=np.arange(3), points=np.full((3, 4, 3), np.nan), controllers=np.zeros((3, 0, 3)))
    answer = http.post(f"/twins/{twin}/diagnoses", content=target.getvalue())
    assert answer.status_code == 422
    assert answer.json()["detail"] == "observation: points: expected some points seen, found NaN everywhere"
    assert serving.staged() == []


def test_it_is_canceled_and_deleted(http, twin, observation):
    job = http.post(f"/twins/{twin}/diagnoses", content=observation).json()
    assert http.post(f"/diagnoses/{job['id']}/cancel").json()["status"] == "canceled"
    assert http.delete(f"/diagnoses/{job['id']}").status_code == 204
    assert http.get(f"/diagnoses/{job['id']}").status_code == 404


def test_the_document_describes_it(http):
    document = http.get("/openapi.json").json()
    post = document["paths"]["/twins/{id}/diagnoses"]["post"]
    form = post["requestBody"]["content"]["multipart/form-data"]["schema"]
    assert form["required"] == []
    assert {"observation", "video", "transfer", "mask"} <= set(form["properties"])
    assert document["paths"]["/diagnoses"]["get"]["summary"] == "List diagnoses, newest first"
