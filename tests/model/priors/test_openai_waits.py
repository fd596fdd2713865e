"""How long the openai prior asks, and waits, where a server fails."""

import threading
import time
from email.utils import formatdate


def test_a_failing_server_is_asked_again_after_a_growing_wait(serve, client, good, view):
    server, waits = serve((500, {}, {}), (503, {}, b"no"), good()), []
    client(server, waits, backoff_s=0.5).material(view())
    assert len(server.requests) == 3
    assert waits == [0.5, 1.0]


def test_retry_after_is_honoured_in_seconds(serve, client, good, view):
    server, waits = serve((429, {"Retry-After": "7"}, {}), good()), []
    client(server, waits).material(view())
    assert waits == [7.0]


def test_retry_after_is_honoured_as_a_date(serve, client, good, view):
    date = formatdate(time.time() + 20, usegmt=True)
    server, waits = serve((503, {"Retry-After": date}, {}), good()), []
    client(server, waits).material(view())
    assert 15 < waits[0] <= 20


def test_nobody_waits_an_hour(serve, client, refused):
    server, waits = serve((429, {"Retry-After": "3600"}, {})), []
    assert "asks to wait 3600 s" in refused(client(server, waits))
    assert waits == []


def test_attempts_are_bounded(serve, client, refused):
    server, waits = serve(*[(500, {}, {"error": {"message": "overloaded"}})] * 3), []
    message = refused(client(server, waits, attempts=3))
    assert "answered 500 (overloaded), 3 times" in message
    assert len(waits) == 2


def test_a_slow_server_times_out_and_is_asked_again(serve, client, good, view):
    gate = threading.Event()
    server = serve(lambda handler: gate.wait(5), good())
    prior = client(server, timeout_s=0.2)
    assert prior.material(view()).shape_class == "solid"
    gate.set()
    assert len(server.requests) == 2


def test_a_server_that_never_answers_is_given_up(serve, client, refused):
    gate = threading.Event()
    server = serve(*[lambda handler: gate.wait(5)] * 2)
    message = refused(client(server, timeout_s=0.1, attempts=2))
    gate.set()
    assert "no answer within 0.1 s, 2 times" in message


def drip(handler):
    """A byte at a time, each soon enough, never an end."""
    handler.send_response(200)
    handler.end_headers()
    try:
        for _ in range(200):
            handler.wfile.write(b" ")
            handler.wfile.flush()
            time.sleep(0.02)
    except OSError:
        return


def test_an_answer_that_drips_is_given_up(serve, client, refused):
    begin = time.monotonic()
    assert "no answer within" in refused(client(serve(drip), timeout_s=0.3, attempts=1))
    assert time.monotonic() - begin < 2


def test_a_broken_connection_is_tried_again(serve, client, good, view):
    server = serve(lambda handler: handler.connection.close(), good())
    assert client(server).material(view()).shape_class == "solid"


def test_no_server_there(serve, client, refused):
    server = serve()
    prior = client(server)
    server.close()
    server.close = lambda: None
    assert "cannot be reached" in refused(prior)
