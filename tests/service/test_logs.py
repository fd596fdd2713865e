import json
import logging
import time

import pytest

from service.logs import JsonFormatter


def line(record: logging.LogRecord) -> dict:
    text = JsonFormatter().format(record)
    assert "\n" not in text
    return json.loads(text)


def record(message: str, **extra) -> logging.LogRecord:
    made = logging.LogRecord("matphys.access", logging.INFO, "file", 1, message, (), None)
    for name, value in extra.items():
        setattr(made, name, value)
    return made


def accesses(caplog: pytest.LogCaptureFixture, count: int) -> list[logging.LogRecord]:
    """The lines of so many requests; a line is written after its answer is sent, so they may take a while."""
    until = time.monotonic() + 10.0
    while True:
        found = [each for each in caplog.records if each.name == "matphys.access"]
        if len(found) >= count or time.monotonic() > until:
            return found
        time.sleep(0.01)


def test_a_record_is_one_line_with_what_it_is_about():
    logged = line(record("request\nforged line", job="a1", status=202, seconds=0.1))
    assert logged["message"] == "request\nforged line"
    assert (logged["job"], logged["status"], logged["level"]) == ("a1", 202, "info")
    assert logged["at"].endswith("Z")


def test_what_is_not_meant_for_the_log_stays_out():
    assert "authorization" not in line(record("request", authorization="Bearer x"))


def test_a_traceback_is_kept():
    try:
        raise ZeroDivisionError
    except ZeroDivisionError as error:
        made = logging.LogRecord(
            "a", logging.ERROR, "f", 1, "failed", (), (type(error), error, error.__traceback__)
        )
    assert "ZeroDivisionError" in line(made)["traceback"]


def test_requests_are_logged_with_their_job_and_never_with_a_key(serving, clip, caplog):
    with serving.client() as http, caplog.at_level(logging.INFO, "matphys.access"):
        key = http.headers["Authorization"].removeprefix("Bearer ")
        job = http.post("/twins", content=clip, headers={"Content-Type": "video/mp4"}).json()["id"]
        http.get(f"/twins/{job}?limit=1&token={key}")
        http.get("/livez")
        posted, shown = accesses(caplog, 2)
    assert (posted.method, posted.route, posted.status, posted.job, posted.kind) == (
        "POST",
        "/twins",
        202,
        job,
        "twin",
    )
    assert (shown.route, shown.job, shown.tenant) == ("/twins/{id}", job, "default")
    assert shown.seconds > 0
    for each in (posted, shown):
        assert key not in JsonFormatter().format(each)


@pytest.mark.parametrize("path", ["/livez", "/metrics"])
def test_what_is_asked_every_few_seconds_is_not_logged(serving, caplog, path):
    import httpx

    with caplog.at_level(logging.INFO, "matphys.access"):
        httpx.get(f"{serving.url}{path}")
        httpx.get(f"{serving.url}/nothing")
        assert [record.status for record in accesses(caplog, 1)] == [404]
