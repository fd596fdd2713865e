import hashlib
import re

import httpx
import pytest

from service.client import ServiceError, TwinRequest

CONTENT = bytes(range(256)) * 40
SHA256 = hashlib.sha256(CONTENT).hexdigest()
FILE = {"name": "bundle.twin.zip", "bytes": len(CONTENT), "sha256": SHA256, "url": "/files/bundle.twin.zip"}


@pytest.fixture
def twin(client, service):
    service.job(status="succeeded", files=[FILE])
    return client.twin("a1")


def broken(*pieces):
    class Stream(httpx.SyncByteStream):
        def __iter__(self):
            yield from pieces
            raise httpx.ReadError("reset")

    return Stream()


def test_options_and_files_travel_in_one_form(client, service, clip_path):
    service.then(
        202, json={"id": "a1", "kind": "twin", "status": "queued", "created_at": "2026-11-21T12:00:00Z"}
    )
    request = TwinRequest(size_m=0.25, box=(1, 2, 30, 40))
    client.submit(clip_path, request, files={"mask": clip_path})
    body = service.asked[0].content.decode("latin-1")
    parts = re.findall(r'name="(\w+)"(?:; filename="([^"]+)")?', body)
    assert parts == [("box", ""), ("size_m", ""), ("video", "clip.mp4"), ("mask", "clip.mp4")]
    assert "1,2,30,40" in body
    assert clip_path.read_bytes().decode() in body


def test_an_upload_that_fails_is_sent_again_whole_with_the_same_key(client, service, clip_path):
    service.breaks().then(503, json={}).job()
    client.submit(clip_path)
    keys = {request.headers["Idempotency-Key"] for request in service.asked}
    assert len(keys) == 1
    assert len(service.asked) == 3
    assert service.asked[-1].content.count(b"frames") == 1000


def test_two_uploads_have_two_keys_unless_one_is_given(client, service, clip_path):
    service.job().job().job()
    client.submit(clip_path)
    client.submit(clip_path)
    client.submit(clip_path, idempotency_key="mine")
    keys = [request.headers["Idempotency-Key"] for request in service.asked]
    assert len(set(keys)) == 3
    assert keys[2] == "mine"


def test_a_clip_that_is_not_there_is_an_os_error(client, tmp_path):
    with pytest.raises(FileNotFoundError):
        client.submit(tmp_path / "none.mp4")


def test_pages_are_fetched_as_they_are_needed(client, service):
    job = {"id": "a1", "kind": "twin", "status": "queued", "created_at": "2026-11-21T12:00:00Z"}
    service.then(json={"items": [job], "next_cursor": "c2"}).then(json={"items": [job | {"id": "a2"}]})
    twins = client.twins(status="queued")
    assert next(twins).id == "a1"
    assert len(service.asked) == 1
    assert [twin.id for twin in twins] == ["a2"]
    assert dict(service.asked[1].url.params) == {"limit": "100", "status": "queued", "cursor": "c2"}


def test_a_download_is_checked_and_replaces_what_was_there(twin, service, tmp_path):
    path = tmp_path / "twin.zip"
    path.write_bytes(b"old")
    service.then(content=CONTENT)
    twin.download("bundle.twin.zip", path)
    assert path.read_bytes() == CONTENT
    assert list(tmp_path.iterdir()) == [path]


def test_a_download_that_breaks_off_goes_on_where_it_broke(twin, service, tmp_path):
    service.then(headers={"ETag": '"x"'}, stream=broken(CONTENT[:1000]))
    service.breaks().then(206, headers={"ETag": '"x"'}, content=CONTENT[1000:])
    twin.download("bundle.twin.zip", tmp_path / "twin.zip")
    assert (tmp_path / "twin.zip").read_bytes() == CONTENT
    last = service.asked[-1].headers
    assert (last["Range"], last["If-Range"]) == ("bytes=1000-", '"x"')


def test_a_service_that_starts_over_is_followed(twin, service, tmp_path):
    service.then(headers={"ETag": '"x"'}, stream=broken(b"something else")).then(content=CONTENT)
    twin.download("bundle.twin.zip", tmp_path / "twin.zip")
    assert (tmp_path / "twin.zip").read_bytes() == CONTENT


def test_damaged_bytes_never_take_the_place(twin, service, tmp_path):
    path = tmp_path / "twin.zip"
    path.write_bytes(b"old")
    service.then(content=CONTENT[:-1])
    with pytest.raises(ServiceError, match="damaged"):
        twin.download("bundle.twin.zip", path)
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_refused_download_leaves_nothing(twin, service, tmp_path):
    service.then(404, json={"type": "x", "title": "Not found", "status": 404})
    with pytest.raises(ServiceError, match="Not found"):
        twin.download("bundle.twin.zip", tmp_path / "twin.zip")
    assert list(tmp_path.iterdir()) == []
