"""A server with an OpenAI-compatible endpoint that answers by a script, and a prior that asks it."""

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest

from model.errors import InputError
from model.priors.materials import MATERIALS
from model.priors.openai import OpenAIPrior
from model.types import PartView

KEY = "sk-very-secret-0123456789"
RANGES = {
    "stiffness": (1e4, 9e4),
    "damping": (0.1, 0.3),
    "drag_rate": (0.2, 1.0),
    "friction": (0.4, 0.9),
    "restitution": (0.05, 0.2),
    "density": (60.0, 150.0),
}


@pytest.fixture
def key():
    """What must never be shown."""
    return KEY


@pytest.fixture(name="answer")
def _answer():
    """What a model says: `answer(friction=…)`."""
    return answer


@pytest.fixture(name="completion")
def _completion():
    """Around what a model says."""
    return completion


@pytest.fixture(name="good")
def _good():
    """A reply of a server, with an answer: `good(friction=…)`."""
    return good


@pytest.fixture(name="view")
def _view():
    """A part of a picture: `view(label=…)`."""
    return view


@pytest.fixture(name="refused")
def _refused():
    """Ask, be refused, and return the one line: `refused(prior)`."""
    return refused


def answer(**changes):
    value = {
        "materials": {name: 0.0 for name in MATERIALS} | {"fur": 3.0, "fabric": 1.0},
        "shape_class": "solid",
        **{name: {"low": low, "high": high} for name, (low, high) in RANGES.items()},
    }
    return value | changes


def completion(content):
    return {"choices": [{"message": {"role": "assistant", "content": content}}]}


def good(**changes):
    return 200, {}, completion(json.dumps(answer(**changes)))


class FakeServer:
    """Answers with a script, one entry per request, and remembers what it was sent."""

    def __init__(self, script):
        self.script, self.requests = list(script), []
        fake = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self):
                body = self.rfile.read(int(self.headers["Content-Length"]))
                fake.requests.append((self.path, dict(self.headers), body))
                step = fake.script.pop(0)
                if callable(step):
                    step(self)
                    return
                status, headers, reply = step
                data = reply if isinstance(reply, bytes) else json.dumps(reply).encode()
                self.send_response(status)
                for name, value in headers.items():
                    self.send_header(name, value)
                self.send_header("Content-Length", str(len(data)))
                self.end_headers()
                self.wfile.write(data)

            def log_message(self, *_):
                pass

        self.http = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.thread = threading.Thread(target=self.http.serve_forever, args=(0.02,))
        self.thread.start()

    @property
    def url(self):
        return f"http://127.0.0.1:{self.http.server_port}/v1"

    def close(self):
        self.http.shutdown()
        self.thread.join()
        self.http.server_close()


@pytest.fixture
def serve(monkeypatch):
    for name in ("HTTP_PROXY", "ALL_PROXY", "http_proxy", "all_proxy"):
        monkeypatch.delenv(name, raising=False)
    servers = []

    def start(*script):
        servers.append(FakeServer(script))
        return servers[-1]

    yield start
    for server in servers:
        server.close()


@pytest.fixture
def client(tmp_path):
    """Make a prior for a server; it notes its waits instead of sleeping."""

    def make(server, waits=None, **options):
        sleep = (lambda seconds: None) if waits is None else waits.append
        settings = {"model": "tiny-vlm", "api_key": KEY, "cache": tmp_path / "cache", "sleep": sleep}
        return OpenAIPrior(server.url, **(settings | options))

    return make


def view(**changes):
    image = np.random.default_rng(0).integers(0, 256, (60, 80, 3), dtype=np.uint8)
    mask, whole = np.zeros((60, 80), bool), np.zeros((60, 80), bool)
    mask[20:30, 20:40], whole[15:50, 15:60] = True, True
    return PartView(**{"image": image, "mask": mask, "object_mask": whole, "label": "part 1"} | changes)


def refused(prior, part=None):
    with pytest.raises(InputError) as caught:
        prior.material(part or view())
    message = str(caught.value)
    assert "\n" not in message
    assert KEY not in message
    assert len(message) < 400
    return message
