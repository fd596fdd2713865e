import socket
import time
from urllib.parse import urlsplit

import httpx
import pytest

from service import connections

KEPT = b"GET /livez HTTP/1.1\r\nHost: x\r\n\r\n"


@pytest.fixture
def prompt(serving, monkeypatch):
    monkeypatch.setattr(connections, "HEAD_SECONDS", 0.5)
    return serving


def seconds_until_hung_up(url: str, first: bytes, more: bytes = b"") -> float:
    """Send `first`, then `more` byte by byte, until the other side has had enough; 3: it never had."""
    address = urlsplit(url)
    with socket.create_connection((address.hostname, address.port), timeout=0.1) as connection:
        started = time.monotonic()
        connection.sendall(first)
        rest = iter(more)
        while time.monotonic() - started < 3:
            try:
                if not connection.recv(65536):
                    break
            except TimeoutError:
                pass
            except ConnectionError:
                break
            byte = next(rest, None)
            if byte is not None:
                connection.sendall(bytes([byte]))
        return time.monotonic() - started


@pytest.mark.parametrize("begun", [b"", b"GET /livez HT"])
def test_who_does_not_finish_a_request_is_hung_up_on(prompt, begun):
    assert 0.4 < seconds_until_hung_up(prompt.url, begun) < 2.5


@pytest.mark.parametrize("first", [b"GET /livez HTTP/1.1\r\n", KEPT])
def test_who_asks_byte_by_byte_is_hung_up_on(prompt, first):
    """At the first request, and at one that follows an answer."""
    assert 0.4 < seconds_until_hung_up(prompt.url, first, b"X-Slow: " + 30 * b"a") < 2.5


def test_who_is_answered_and_sends_on_is_hung_up_on(prompt):
    """A body that nobody asked for, and that of a request without a key: one more byte holds nothing open."""
    head = b"POST /twins HTTP/1.1\r\nHost: x\r\nContent-Type: video/mp4\r\nContent-Length: 1000000\r\n\r\n"
    for first in (KEPT.replace(b"\r\n\r\n", b"\r\nContent-Length: 1000000\r\n\r\n"), head):
        assert seconds_until_hung_up(prompt.url, first, b"a") < 2.5


def test_an_answer_that_takes_long_is_not_cut(prompt, http, clip):
    twin = http.post("/twins", content=clip, headers={"Content-Type": "video/mp4"}).headers["Location"]
    with pytest.raises(httpx.ReadTimeout), http.stream("GET", f"{twin}/events", timeout=1.5) as stream:
        for _ in stream.iter_raw():
            pass
