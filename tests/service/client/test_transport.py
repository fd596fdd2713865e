import httpx
import pytest

from service.client import Client, ServiceError

PROBLEM = {
    "type": "urn:matphys:problem:invalid-request",
    "title": "The request does not hold what it must",
    "status": 422,
    "detail": "parts: too many",
    "instance": "urn:uuid:1",
    "errors": [{"field": "parts", "message": "too many"}],
}


def test_the_key_travels_in_its_header(client, service):
    service.job()
    client.twin("a1")
    assert service.asked[0].headers["Authorization"] == "Bearer secret"


def test_a_problem_becomes_one_error_with_its_fields(client, service):
    service.then(422, json=PROBLEM)
    with pytest.raises(ServiceError, match="parts: too many") as raised:
        client.twin("a1")
    error = raised.value
    assert (error.status, error.type, error.title) == (422, PROBLEM["type"], PROBLEM["title"])
    assert (error.detail, error.instance) == ("parts: too many", "urn:uuid:1")
    assert error.errors == ({"field": "parts", "message": "too many"},)
    assert len(service.asked) == 1


def test_the_page_of_a_proxy_is_told_by_its_status(client, service):
    service.then(403, text="<html>no</html>")
    with pytest.raises(ServiceError, match="403 Forbidden") as raised:
        client.twin("a1")
    assert raised.value.status == 403


def test_what_may_pass_is_asked_again_and_retry_after_is_kept(client, service):
    service.then(503, headers={"Retry-After": "7"}, json=PROBLEM | {"status": 503}).breaks().job()
    assert client.twin("a1").id == "a1"
    assert client.slept[0] == 7
    assert 0 < client.slept[1] < 1


def test_patience_ends(service):
    service.breaks()
    with (
        Client("http://test", "k", patience_s=0, http=httpx.MockTransport(service)) as client,
        pytest.raises(ServiceError, match=r"http://test.* cannot be reached: refused") as raised,
    ):
        client.twin("a1")
    assert raised.value.status is None


def test_a_wait_longer_than_the_patience_is_not_begun(client, service):
    service.then(429, headers={"Retry-After": "3600"}, json=PROBLEM | {"status": 429})
    with pytest.raises(ServiceError) as raised:
        client.twin("a1")
    assert raised.value.retry_after == 3600
    assert client.slept == []


def test_a_retry_after_may_be_a_moment(client, service):
    service.then(503, headers={"Retry-After": "Fri, 31 Dec 1999 23:59:59 GMT"}, json={}).job()
    client.twin("a1")
    assert client.slept == [0.0]


def test_an_answer_of_something_else_is_said_to_be_one(client, service):
    service.then(200, text="<html>Welcome to nginx</html>")
    with pytest.raises(ServiceError, match="not one of this service"):
        client.twin("a1")


def test_ids_do_not_lead_elsewhere(client, service):
    service.job()
    client.twin("../metrics?x")
    assert service.asked[0].url.raw_path == b"/twins/..%2Fmetrics%3Fx"
