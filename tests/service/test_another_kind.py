"""A further kind of job costs one class for the worker and one `Resource` for the front: here is one."""

from collections.abc import Mapping
from typing import Annotated, ClassVar

import pytest
from pydantic import BaseModel, Field

from model.job_schema import JobRequest
from service.resources import Resource
from service.routes.twins import TWINS
from worker.kinds.base import Input, Kind, Outcome, Run

# What the file of a diagnosis will hold, about.


class ComparisonRequest(JobRequest):
    tolerance: Annotated[float, Field(gt=0)] = 0.01


class ComparisonKind(Kind):
    name: ClassVar[str] = "comparison"
    queue: ClassVar[str] = "twins"
    options: ClassVar[type[BaseModel]] = ComparisonRequest
    inputs: ClassVar[Mapping[str, Input]] = {
        "observation": Input("controllers", required=True),
        "video": Input("video"),
    }
    limit_s: ClassVar[float] = 60.0

    def run(self, run: Run) -> Outcome:
        report = run.folder / "report.json"
        report.write_text("{}")
        return Outcome((report,))


COMPARISONS = Resource(ComparisonKind, "/comparisons", "comparison", parent=TWINS)


@pytest.fixture
def serving(serve):
    return serve(children=(COMPARISONS,))


@pytest.fixture
def observation() -> bytes:
    import io

    import numpy as np

    target = io.BytesIO()
    np.savez(target, controls=np.zeros((3, 1, 3)))
    return target.getvalue()


@pytest.fixture
def twin(serving, http, clip, tmp_path) -> str:
    twin = http.post("/twins", content=clip, headers={"Content-Type": "video/mp4"}).json()["id"]
    serving.finish(twin, {"bundle.twin.zip": b"bundle"}, tmp_path)
    return twin


def test_it_is_submitted_below_its_twin_and_has_all_routes(serving, http, twin, observation, tmp_path):
    answer = http.post(f"/twins/{twin}/comparisons", content=observation, params={"tolerance": 0.5})
    assert answer.status_code == 202, answer.text
    job = answer.json()
    assert answer.headers["Location"] == job["urls"]["self"] == f"/comparisons/{job['id']}"
    assert job["kind"] == "comparison"
    assert job["parent"] == twin
    assert job["options"] == {"tolerance": 0.5}
    assert http.get(f"/twins/{twin}/comparisons").json()["items"] == [job]
    assert [each["id"] for each in http.get("/comparisons").json()["items"]] == [job["id"]]
    serving.finish(job["id"], {"report.json": b"{}"}, tmp_path)
    assert http.get(f"/comparisons/{job['id']}/files/report.json").json() == {}
    assert http.get(f"/comparisons/{job['id']}/logs").status_code == 200
    assert http.get(f"/twins/{job['id']}").status_code == 404
    assert http.delete(f"/comparisons/{job['id']}").status_code == 204


def test_its_inputs_are_looked_into(http, twin, clip, observation):
    assert http.post(f"/twins/{twin}/comparisons", content=b"text").status_code == 415
    as_video = http.post(f"/twins/{twin}/comparisons", content=clip, headers={"Content-Type": "video/mp4"})
    assert as_video.json()["detail"].startswith("observation is missing")
    both = http.post(f"/twins/{twin}/comparisons", files={"observation": observation, "video": clip})
    assert both.status_code == 202


def test_it_waits_for_its_twin(serving, http, clip, observation):
    twin = http.post("/twins", content=clip, headers={"Content-Type": "video/mp4"}).json()["id"]
    answer = http.post(f"/twins/{twin}/comparisons", content=observation)
    assert answer.status_code == 409
    assert int(answer.headers["Retry-After"]) >= 1
    http.post(f"/twins/{twin}/cancel")
    assert "canceled" in http.post(f"/twins/{twin}/comparisons", content=observation).json()["detail"]


def test_it_is_deleted_with_its_twin(http, twin, observation):
    job = http.post(f"/twins/{twin}/comparisons", content=observation).json()
    assert http.delete(f"/twins/{twin}").status_code == 204
    assert http.get(f"/comparisons/{job['id']}").status_code == 404


def test_another_tenant_cannot_work_on_it(serving, twin, observation):
    with serving.client("other", ("submit", "read")) as other:
        assert other.post(f"/twins/{twin}/comparisons", content=observation).status_code == 404
        assert other.get(f"/twins/{twin}/comparisons").status_code == 404


def test_the_document_and_the_page_offer_it(http):
    paths = http.get("/openapi.json").json()["paths"]
    assert {"/twins/{id}/comparisons", "/comparisons", "/comparisons/{id}/events"} <= set(paths)
    names = {each["name"] for each in paths["/twins/{id}/comparisons"]["post"]["parameters"]}
    assert names >= {"id", "tolerance", "Idempotency-Key"}
    assert "comparison" in http.get("/").text
