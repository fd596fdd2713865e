import socket
import ssl
import threading
from datetime import UTC, datetime, timedelta
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest
from standardwebhooks.webhooks import Webhook, WebhookVerificationError

from worker.webhooks import Undelivered, deliver, is_public, secret_of


class Receiver(BaseHTTPRequestHandler):
    def do_POST(self):
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.server.got.append((dict(self.headers), body, self.path))
        self.send_response(self.server.answer)
        self.send_header("Location", "http://127.0.0.1:9/elsewhere")
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *arguments):
        pass


@pytest.fixture
def receiver():
    server = HTTPServer(("127.0.0.1", 0), Receiver)
    server.got, server.answer = [], 204
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield server
    server.shutdown()
    server.server_close()
    thread.join()


@pytest.fixture
def url(receiver):
    return f"http://127.0.0.1:{receiver.server_port}/hook"


def test_what_arrives_is_signed(receiver, url, client):
    secret = secret_of(client, "a")
    deliver(url, "message-1", datetime.now(UTC), b'{"type": "twin.succeeded"}', secret, allow_private=True)
    ((headers, body, path),) = receiver.got
    assert path == "/hook"
    assert Webhook(secret).verify(body, headers) == {"type": "twin.succeeded"}
    assert headers["Webhook-Id"] == "message-1"
    with pytest.raises(WebhookVerificationError):
        Webhook(secret_of(client, "b")).verify(body, headers)
    with pytest.raises(WebhookVerificationError):
        Webhook(secret).verify(body + b" ", headers)


def test_an_old_message_does_not_pass(receiver, url, client):
    secret = secret_of(client, "a")
    deliver(url, "m", datetime.now(UTC) - timedelta(minutes=10), b"{}", secret, allow_private=True)
    ((headers, body, _),) = receiver.got
    with pytest.raises(WebhookVerificationError):
        Webhook(secret).verify(body, headers)


def test_a_tenant_has_one_secret_of_its_own(client):
    assert secret_of(client, "a") == secret_of(client, "a") != secret_of(client, "b")
    assert secret_of(client, "a").startswith("whsec_")


@pytest.mark.parametrize("answer", [301, 302, 400, 404, 500])
def test_anything_but_success_is_no_delivery_and_no_redirect_is_followed(receiver, url, client, answer):
    receiver.answer = answer
    with pytest.raises(Undelivered, match=str(answer)):
        deliver(url, "m", datetime.now(UTC), b"{}", secret_of(client, "a"), allow_private=True)
    assert len(receiver.got) == 1


@pytest.mark.parametrize(
    "host", ["127.0.0.1", "localhost", "[::1]", "0.0.0.0", "[::ffff:127.0.0.1]", "127.1", "2130706433"]
)
def test_addresses_inside_are_not_connected_to(receiver, client, host):
    with pytest.raises(Undelivered):
        deliver(
            f"http://{host}:{receiver.server_port}/", "m", datetime.now(UTC), b"{}", secret_of(client, "a")
        )
    assert receiver.got == []


def test_the_address_that_counts_is_the_one_connected_to(receiver, client, monkeypatch):
    """A name that is public when asked first and private the second time gets no second time."""
    asked = []

    def resolve(host, port, *arguments, **options):
        asked.append(host)
        address = "93.184.215.14" if len(asked) == 1 else "127.0.0.1"
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (address, port))]

    connected = []

    def connect(address, *arguments, **options):
        connected.append(address[0])
        raise TimeoutError

    monkeypatch.setattr(socket, "getaddrinfo", resolve)
    monkeypatch.setattr(socket, "create_connection", connect)
    with pytest.raises(Undelivered):
        deliver("http://rebinding.example/", "m", datetime.now(UTC), b"{}", "whsec_YQ==")
    assert (asked, connected) == (["rebinding.example"], ["93.184.215.14"])


def test_a_name_with_many_silent_addresses_is_given_up(monkeypatch):
    entries = [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (f"93.184.215.{n}", 80)) for n in range(1, 30)]
    connected = []

    def connect(address, *arguments, **options):
        connected.append(address[0])
        raise TimeoutError

    monkeypatch.setattr(socket, "getaddrinfo", lambda *a, **k: entries)
    monkeypatch.setattr(socket, "create_connection", connect)
    with pytest.raises(Undelivered):
        deliver("http://many.example/", "m", datetime.now(UTC), b"{}", "whsec_YQ==")
    assert connected == ["93.184.215.1", "93.184.215.2"]


def test_one_private_address_among_public_ones_is_enough_to_refuse(monkeypatch):
    entries = [
        (socket.AF_INET, socket.SOCK_STREAM, 6, "", (address, 80))
        for address in ("93.184.215.14", "10.0.0.1")
    ]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *a, **k: entries)
    monkeypatch.setattr(socket, "create_connection", lambda *a, **k: pytest.fail("it connected"))
    with pytest.raises(Undelivered, match=r"ConnectError: .*not a public address"):
        deliver("http://mixed.example/", "m", datetime.now(UTC), b"{}", "whsec_YQ==")


@pytest.mark.parametrize("url", ["ftp://example.org/", "unix:/tmp/x", "http://", "http://[", "nonsense"])
def test_urls_that_cannot_be_posted_to_are_no_delivery(url):
    with pytest.raises(Undelivered):
        deliver(url, "m", datetime.now(UTC), b"{}", "whsec_YQ==", allow_private=True)


def test_a_receiver_that_never_answers_is_given_up(client, monkeypatch):
    monkeypatch.setattr("worker.webhooks.ANSWER_S", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"http://127.0.0.1:{silent.getsockname()[1]}/"
        with pytest.raises(Undelivered, match="no answer"):
            deliver(address, "m", datetime.now(UTC), b"{}", "whsec_YQ==", allow_private=True)


def test_a_certificate_nobody_vouches_for_is_no_delivery(receiver, client, tmp_path, monkeypatch):
    context = ssl.create_default_context()
    seen = []
    monkeypatch.setattr(ssl, "create_default_context", lambda: seen.append(context) or context)
    with pytest.raises(Undelivered):
        deliver(
            f"https://127.0.0.1:{receiver.server_port}/",
            "m",
            datetime.now(UTC),
            b"{}",
            "whsec_YQ==",
            allow_private=True,
        )
    assert seen[0].verify_mode == ssl.CERT_REQUIRED
    assert receiver.got == []


@pytest.mark.parametrize("address", ["93.184.215.14", "2606:2800:21f:cb07:6820:80da:af6b:8b2c", "1.1.1.1"])
def test_public(address):
    assert is_public(address)


@pytest.mark.parametrize(
    "address",
    [
        "10.1.2.3",
        "172.16.0.1",
        "192.168.1.1",
        "169.254.169.254",
        "100.64.0.1",
        "0.0.0.0",
        "224.0.0.1",
        "255.255.255.255",
        "::1",
        "::",
        "fe80::1%eth0",
        "fc00::1",
        "ff02::1",
        "::ffff:10.0.0.1",
        "64:ff9b::7f00:1",
        "::127.0.0.1",
        "::ffff:0:127.0.0.1",
        "fec0::1",
        "192.0.0.192",
        "168.63.129.16",
        "2002:7f00:1::",
        "2001::1",
    ],
)
def test_not_public(address):
    assert not is_public(address)
