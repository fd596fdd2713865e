import re
from dataclasses import fields

import pytest
from pydantic import ValidationError

from model.job_schema import FINAL_STATUSES, Job, TwinRequest
from model.pipeline import TwinOptions

FILES = {"mask", "camera", "mesh", "depth", "controllers"}
SERVERS_OWN = {"renderer"}
OF_FOLDERS = {"fps"}
"""Over HTTP a clip is one file."""


def test_a_request_offers_every_option_of_the_pipeline_that_is_no_file():
    assert (
        set(TwinRequest.model_fields) - {"webhook"}
        == {f.name for f in fields(TwinOptions)} - FILES - SERVERS_OWN - OF_FOLDERS
    )


def test_a_request_that_chooses_nothing_chooses_what_the_pipeline_does():
    options = TwinOptions()
    for name in set(TwinRequest.model_fields) - {"webhook"}:
        assert getattr(TwinRequest(), name) == getattr(options, name), name


def test_a_box_is_one_text():
    assert TwinRequest(box="12,8,200,150").box == (12, 8, 200, 150)


@pytest.mark.parametrize(
    "box",
    [
        "",
        "1,2,3",
        "1,2,3,4,5",
        "a,b,c,d",
        "1,2,0,4",
        "-1,2,3,4",
        "1.5,2,3,4",
        "1,2,3,100000",
        "1, 2,3,4",
        "1,2,3,4\n",
    ],
)
def test_a_box_that_is_none_is_refused(box):
    with pytest.raises(ValidationError):
        TwinRequest(box=box)


def test_what_the_schema_says_of_a_box_is_what_is_taken():
    pattern = TwinRequest.model_json_schema()["properties"]["box"]["pattern"]
    assert re.search(pattern, "12,8,200,150")
    assert not re.search(pattern, "1,2,0,4")


@pytest.mark.parametrize(
    "request_",
    [
        {"size_m": "nan"},
        {"size_m": 0},
        {"parts": 0},
        {"points": 10**6},
        {"surprise": 1},
        {"webhook": "ftp://example.org"},
        {"webhook": "https://a b"},
    ],
)
def test_nonsense_is_refused(request_):
    with pytest.raises(ValidationError):
        TwinRequest(**request_)


def test_the_final_statuses_are_statuses():
    assert set(FINAL_STATUSES) < set(Job.model_json_schema()["properties"]["status"]["enum"])
