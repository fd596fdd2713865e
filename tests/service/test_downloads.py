import hashlib

import pytest

CONTENT = bytes(range(100))
TAG = f'"{hashlib.sha256(CONTENT).hexdigest()}"'
FILES = {"bundle.twin.zip": CONTENT, "preview.mp4": CONTENT, "report.html": CONTENT}


@pytest.fixture
def url(serving, http, clip, tmp_path) -> str:
    twin = http.post("/twins", content=clip, headers={"Content-Type": "video/mp4"}).json()["id"]
    serving.finish(twin, FILES, tmp_path)
    return f"/twins/{twin}/files"


def test_a_file_comes_whole_with_name_and_validator(http, url):
    answer = http.get(f"{url}/bundle.twin.zip")
    assert answer.content == CONTENT
    assert answer.headers["Content-Type"] == "application/zip"
    assert answer.headers["Content-Disposition"] == 'attachment; filename="bundle.twin.zip"'
    assert answer.headers["ETag"] == TAG
    assert answer.headers["Accept-Ranges"] == "bytes"
    assert answer.headers["Content-Length"] == "100"
    assert "private" in answer.headers["Cache-Control"]


def test_only_what_holds_no_script_is_shown_in_place(http, url):
    assert http.get(f"{url}/preview.mp4").headers["Content-Disposition"].startswith("inline")
    report = http.get(f"{url}/report.html").headers
    assert report["Content-Disposition"].startswith("attachment")
    assert report["Content-Security-Policy"] == "default-src 'none'; sandbox"


def test_the_head_of_a_file_has_no_body(http, url):
    answer = http.head(f"{url}/bundle.twin.zip", headers={"Range": "bytes=0-9"})
    assert answer.status_code == 200, "a range is about GET alone"
    assert "Content-Range" not in answer.headers
    assert answer.headers["Content-Length"] == "100"
    assert answer.headers["ETag"] == TAG
    assert answer.content == b""


@pytest.mark.parametrize(
    ("wanted", "start", "end"),
    [
        ("bytes=0-0", 0, 1),
        ("bytes=10-19", 10, 20),
        ("bytes=90-", 90, 100),
        ("bytes=90-1000", 90, 100),
        ("bytes=-10", 90, 100),
        ("bytes=-1000", 0, 100),
    ],
)
def test_a_part_of_a_file(http, url, wanted, start, end):
    answer = http.get(f"{url}/bundle.twin.zip", headers={"Range": wanted})
    assert answer.status_code == 206
    assert answer.content == CONTENT[start:end]
    assert answer.headers["Content-Range"] == f"bytes {start}-{end - 1}/100"


@pytest.mark.parametrize("wanted", ["bytes=100-", "bytes=100-200", "bytes=-0"])
def test_a_part_outside_the_file_is_refused(http, url, wanted):
    answer = http.get(f"{url}/bundle.twin.zip", headers={"Range": wanted})
    assert answer.status_code == 416
    assert answer.headers["Content-Range"] == "bytes */100"
    assert answer.headers["Content-Type"] == "application/problem+json"


@pytest.mark.parametrize(
    "wanted",
    ["bytes=5-2", "bytes=a-b", "lines=1-2", "bytes=", "bytes=0-1,5-6", "bytes=-", "bytes=" + "9" * 40 + "-"],
)
def test_a_range_that_is_none_gives_the_whole(http, url, wanted):
    answer = http.get(f"{url}/bundle.twin.zip", headers={"Range": wanted})
    assert answer.status_code == 200
    assert answer.content == CONTENT


def test_who_has_it_gets_nothing(http, url):
    for tag in (TAG, f"W/{TAG}", f'"other", {TAG}', "*"):
        answer = http.get(f"{url}/bundle.twin.zip", headers={"If-None-Match": tag})
        assert answer.status_code == 304
        assert answer.content == b""
        assert answer.headers["ETag"] == TAG
    assert http.get(f"{url}/bundle.twin.zip", headers={"If-None-Match": '"other"'}).status_code == 200


def test_a_part_of_another_version_is_the_whole(http, url):
    whole = http.get(f"{url}/bundle.twin.zip", headers={"Range": "bytes=0-9", "If-Range": '"other"'})
    assert (whole.status_code, whole.content) == (200, CONTENT)
    part = http.get(f"{url}/bundle.twin.zip", headers={"Range": "bytes=0-9", "If-Range": TAG})
    assert (part.status_code, part.content) == (206, CONTENT[:10])


def test_a_file_that_the_store_has_lost_is_not_found(serving, http, url):
    (key,) = [key for key in serving.stored() if key.endswith("bundle.twin.zip")]
    serving.storage.delete(key)
    assert http.get(f"{url}/bundle.twin.zip").status_code == 404
