import re

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient

from model.job_schema import JobRequest, TwinRequest
from service.errors import install
from service.pages.offers import Format, make_offer
from service.pages.routes import page_router


class DanceRequest(JobRequest):
    tempo: int = 120


@pytest.fixture(scope="module")
def page():
    twin = make_offer("twin", "twins", TwinRequest, ("video", "mask"), required=("video",))
    dance = make_offer("dance", "dances", DanceRequest, ("music",), required=("music",), help="<b>Moves</b>")
    app = FastAPI()
    install(app)
    app.include_router(page_router(twin, [dance], [Format("ply", "PLY", "Gaussians")], "500 MB"))
    with TestClient(app) as client:
        yield client


def test_the_page_needs_no_key_and_forbids_everything_from_elsewhere(page):
    answer = page.get("/")
    assert answer.status_code == 200
    policy = answer.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "http" not in policy
    assert not re.search(r"(src|href)=\"(https?:)?//", answer.text)
    assert not re.search(r"<style|\sstyle=|\son\w+=|<script(?! type=\"module\" src)", answer.text)


def test_everything_the_page_loads_is_there_and_kept_for_good(page):
    links = set(re.findall(r"/static/[^\"]+", page.get("/").text))
    assert {link.rsplit(".", 1)[1] for link in links} == {"css", "js", "svg"}
    for link in links:
        answer = page.get(link)
        assert answer.status_code == 200
        assert "immutable" in answer.headers["Cache-Control"]


def test_scripts_import_files_that_are_there(page):
    (entry,) = re.findall(r"/static/[^\"]+page.js", page.get("/").text)
    folder = entry.rsplit("/", 1)[0]
    seen, todo = set(), ["page.js"]
    while todo:
        name = todo.pop()
        if name not in seen:
            seen.add(name)
            answer = page.get(f"{folder}/{name}")
            assert answer.headers["Content-Type"].startswith("text/javascript"), name
            todo += re.findall(r'from "\./([\w.]+)"', answer.text)
    assert len(seen) > 3


def test_files_of_another_version_are_not_kept(page):
    assert page.get("/static/older/page.js").headers["Cache-Control"] == "no-cache"


def test_what_is_known_is_not_sent_again(page):
    first = page.get("/")
    again = page.get("/", headers={"If-None-Match": first.headers["ETag"]})
    assert (again.status_code, again.content) == (304, b"")


@pytest.mark.parametrize("name", ["nothing.js", "..%2froutes.py", "routes.py", "__init__.py"])
def test_nothing_else_is_served(page, name):
    assert page.get(f"/static/x/{name}").status_code == 404


def test_a_further_kind_of_job_has_its_form_and_its_text_is_no_markup(page):
    text = page.get("/").text
    section = text[text.index('data-kind="dance"') :]
    assert 'data-collection="dances"' in section
    assert 'name="music"' in section
    assert 'name="tempo"' in section
    assert "&lt;b&gt;Moves" in section


def test_every_field_has_a_label_and_ids_are_unique(page):
    text = page.get("/").text
    ids = re.findall(r'\sid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    fields = re.findall(r'<(?:input|select)[^>]*\sid="([^"]+)"', text)
    assert fields
    for field in fields:
        assert f'for="{field}"' in text, field
    for described in re.findall(r'aria-(?:describedby|labelledby)="([^"]+)"', text):
        assert described in ids, described
