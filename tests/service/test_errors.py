import errno

import pytest
import redis.exceptions
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException

from model.errors import InputError
from service.errors import TITLES, ProblemError, translate
from worker.storage import StorageError


@pytest.mark.parametrize(
    ("error", "name"),
    [
        (ProblemError("conflict"), "conflict"),
        (InputError("camera: no such key"), "bad-input"),
        (HTTPException(404), "not-found"),
        (HTTPException(405), "method-not-allowed"),
        (HTTPException(400, "There was an error parsing the body"), "bad-request"),
        (HTTPException(418), "bad-request"),
        (HTTPException(502), "internal"),
        (redis.exceptions.ConnectionError("Error 111 connecting to 10.0.0.7:6379"), "unavailable"),
        (redis.exceptions.TimeoutError(), "unavailable"),
        (redis.exceptions.OutOfMemoryError(), "unavailable"),
        (StorageError("http://10.0.0.9/bucket: no space left"), "unavailable"),
        (OSError(errno.ENOSPC, "No space left on device", "/srv/secret"), "no-space"),
        (OSError(errno.EACCES, "Permission denied", "/srv/secret"), "internal"),
        (KeyError("secret"), "internal"),
    ],
)
def test_every_error_is_a_problem_that_leaks_nothing(error, name):
    problem = translate(error)
    assert problem.name == name
    assert (problem.status, problem.title) == TITLES[name]
    assert "10.0.0" not in str(problem.detail)
    assert "secret" not in str(problem.detail)
    assert ("Retry-After" in problem.headers) == (problem.status == 503)


def test_fields_are_named_and_what_was_sent_is_not_repeated():
    errors = [
        {"loc": ("query", "parts"), "msg": "Input should be less than 64", "input": "s3cret"},
        {"loc": ("box",), "msg": "Value error, Expected four numbers", "input": "s3cret"},
    ]
    problem = translate(RequestValidationError(errors))
    assert problem.status == 422
    assert problem.detail == "query.parts: input should be less than 64"
    assert problem.extensions["errors"][1] == {"field": "box", "message": "expected four numbers"}
    assert "s3cret" not in str(problem.extensions)


def test_a_problem_that_is_not_in_the_table_is_our_mistake():
    with pytest.raises(KeyError):
        ProblemError("surprise")


@pytest.mark.parametrize(("seconds", "header"), [(0, "1"), (0.2, "1"), (1, "2"), (30, "30")])
def test_who_is_told_to_wait_does_not_come_back_too_early(seconds, header):
    assert int(ProblemError("unavailable", retry_after=seconds).headers["Retry-After"]) >= max(1, seconds)


def test_an_error_of_ours_is_logged_and_hidden(serving, monkeypatch, caplog):
    def fail(self, *args, **kwargs):
        raise ZeroDivisionError("/srv/secret")

    with serving.client() as http:
        monkeypatch.setattr("worker.records.Records.list", fail)
        answer = http.get("/twins")
    assert answer.status_code == 500
    assert answer.headers["Content-Type"] == "application/problem+json"
    assert answer.headers["X-Content-Type-Options"] == "nosniff"
    assert "secret" not in answer.text
    record = next(record for record in caplog.records if record.exc_info)
    assert "ZeroDivisionError" in caplog.text
    assert answer.json()["instance"] == f"urn:uuid:{record.request_id}"
