import socket
import time
from urllib.parse import urlsplit

import httpx
import pytest


def talk(url: str, request: bytes, seconds: float = 5.0) -> tuple[bytes, float]:
    """Send bytes and read the answer while more is promised than sent."""
    address = urlsplit(url)
    with socket.create_connection((address.hostname, address.port), timeout=seconds) as connection:
        started = time.monotonic()
        connection.sendall(request)
        answer = connection.recv(65536)
        return answer, time.monotonic() - started


def head(key: str, length: int, *more: str) -> bytes:
    lines = ["POST /twins HTTP/1.1", "Host: x", f"Authorization: Bearer {key}", f"Content-Length: {length}"]
    return "\r\n".join([*lines, "Content-Type: video/mp4", *more, "", ""]).encode()


def test_who_has_no_key_is_told_before_the_body(serving):
    answer, seconds = talk(serving.url, head("nobody", 4_000_000))
    assert answer.startswith(b"HTTP/1.1 401")
    assert b"WWW-Authenticate: Bearer" in answer or b"www-authenticate: Bearer" in answer
    assert seconds < 2
    assert serving.staged() == []


def test_who_may_not_submit_is_told_before_the_body(serving):
    _, key = serving.keys.create("reader", "default", ("read",))
    assert talk(serving.url, head(key, 4_000_000))[0].startswith(b"HTTP/1.1 403")


def test_who_asks_first_is_told_without_having_to_send(serving):
    answer, _ = talk(serving.url, head("nobody", 4_000_000, "Expect: 100-continue"))
    assert answer.startswith(b"HTTP/1.1 401")


def test_what_is_too_large_is_refused_by_its_announcement(serving):
    _, key = serving.keys.create("a", "default", ("submit",))
    answer, _ = talk(serving.url, head(key, 10**12))
    assert answer.startswith(b"HTTP/1.1 413")


@pytest.mark.parametrize("header", ["", "Bearer", "Basic YTpi", "Bearer a b", "bearer x", "Bearer \xff"])
def test_a_header_that_is_no_key_is_refused(serving, header):
    answer = httpx.get(f"{serving.url}/twins", headers={"Authorization": header.encode("latin-1")})
    assert answer.status_code == 401
    assert answer.json()["type"].endswith(":unauthorized")


def test_a_key_in_the_address_is_no_key(serving):
    _, key = serving.keys.create("a", "default", ("read",))
    assert httpx.get(f"{serving.url}/twins", params={"key": key, "access_token": key}).status_code == 401


def test_a_revoked_key_is_refused_from_the_next_request_on(serving):
    made, key = serving.keys.create("a", "default", ("read",))
    headers = {"Authorization": f"Bearer {key}"}
    assert httpx.get(f"{serving.url}/twins", headers=headers).status_code == 200
    serving.keys.revoke(made.id)
    assert httpx.get(f"{serving.url}/twins", headers=headers).status_code == 401


def test_who_tries_keys_is_slowed_down(serve):
    serving = serve(refusals_per_minute=3)
    _, key = serving.keys.create("a", "default", ("read",))
    statuses = [
        httpx.get(f"{serving.url}/twins", headers={"Authorization": f"Bearer mp_{n}_x"}).status_code
        for n in range(5)
    ]
    assert statuses == [401, 401, 401, 429, 429]
    answer = httpx.get(f"{serving.url}/twins")
    assert answer.status_code == 429
    assert int(answer.headers["Retry-After"]) >= 1
    # Behind a proxy all share one address: who has a key is not locked out by who has none.
    assert httpx.get(f"{serving.url}/twins", headers={"Authorization": f"Bearer {key}"}).status_code == 200


def test_who_asks_too_much_is_slowed_down_alone(serve):
    serving = serve(requests_per_minute=3)
    with serving.client() as one, serving.client() as other:
        assert [one.get("/twins").status_code for _ in range(4)] == [200, 200, 200, 429]
        assert other.get("/twins").status_code == 200
