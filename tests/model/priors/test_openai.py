"""The openai prior against a fake server over real HTTP."""

import json
import threading
import time
from email.utils import formatdate
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest

from model.errors import InputError
from model.priors.materials import MATERIALS, UNITS
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


def test_a_good_answer_becomes_a_belief(serve, client):
    server = serve(good())
    prior = client(server).material(view())
    assert prior.distribution[MATERIALS.index("fur")] == pytest.approx(0.75)
    assert prior.distribution.sum() == pytest.approx(1.0)
    assert prior.shape_class == "solid"
    assert prior.warnings == ()
    assert {name: each.unit for name, each in prior.properties.items()} == dict(UNITS)
    assert prior.properties["stiffness"].mean == pytest.approx(3e4)
    assert prior.properties["stiffness"].spread == pytest.approx(np.log(9) / (2 * 1.645))


def test_a_shape_that_is_known_is_told_and_believed(serve, client):
    server = serve(good())
    prior = client(server).material(view(shape_class="rope"))
    text = json.loads(server.requests[0][2])["messages"][0]["content"][0]["text"]
    assert "known to be of the shape class rope" in text
    assert prior.shape_class == "rope"


def test_the_request_is_a_chat_completion_with_picture_and_schema(serve, client):
    server = serve(good())
    prior = client(server)
    prior.material(view())
    path, headers, body = server.requests[0]
    request = json.loads(body)
    assert path == "/v1/chat/completions"
    assert headers["Authorization"] == f"Bearer {KEY}"
    assert request["model"] == prior.weights == "tiny-vlm"
    text, picture = request["messages"][0]["content"]
    assert "One part" in text["text"]
    assert picture["image_url"]["url"].startswith("data:image/png;base64,")
    wanted = request["response_format"]
    assert wanted["type"] == "json_schema"
    schema = wanted["json_schema"]["schema"]
    assert wanted["json_schema"]["strict"] is True
    assert schema["additionalProperties"] is False
    assert set(schema["required"]) == {"materials", "shape_class", *UNITS}
    assert set(schema["$defs"]["Weights"]["required"]) == set(MATERIALS)
    # Strict endpoints take no keyword beside a reference.
    assert all(set(each) == {"$ref"} for each in schema["properties"].values() if "$ref" in each)
    assert KEY.encode() not in body


def test_without_a_key_none_is_sent(serve, client):
    server = serve(good())
    client(server, api_key="").material(view())
    assert "Authorization" not in server.requests[0][1]


def test_a_fenced_answer_is_read(serve, client):
    server = serve((200, {}, completion(f"```json\n{json.dumps(answer())}\n```")))
    assert client(server).material(view()).shape_class == "solid"


def test_a_failing_server_is_asked_again_after_a_growing_wait(serve, client):
    server, waits = serve((500, {}, {}), (503, {}, b"no"), good()), []
    client(server, waits, backoff_s=0.5).material(view())
    assert len(server.requests) == 3
    assert waits == [0.5, 1.0]


def test_retry_after_is_honoured_in_seconds(serve, client):
    server, waits = serve((429, {"Retry-After": "7"}, {}), good()), []
    client(server, waits).material(view())
    assert waits == [7.0]


def test_retry_after_is_honoured_as_a_date(serve, client):
    date = formatdate(time.time() + 20, usegmt=True)
    server, waits = serve((503, {"Retry-After": date}, {}), good()), []
    client(server, waits).material(view())
    assert 15 < waits[0] <= 20


def test_nobody_waits_an_hour(serve, client):
    server, waits = serve((429, {"Retry-After": "3600"}, {})), []
    assert "asks to wait 3600 s" in refused(client(server, waits))
    assert waits == []


def test_attempts_are_bounded(serve, client):
    server, waits = serve(*[(500, {}, {"error": {"message": "overloaded"}})] * 3), []
    message = refused(client(server, waits, attempts=3))
    assert "answered 500 (overloaded), 3 times" in message
    assert len(waits) == 2


def test_a_slow_server_times_out_and_is_asked_again(serve, client):
    gate = threading.Event()
    server = serve(lambda handler: gate.wait(5), good())
    prior = client(server, timeout_s=0.2)
    assert prior.material(view()).shape_class == "solid"
    gate.set()
    assert len(server.requests) == 2


def test_a_server_that_never_answers_is_given_up(serve, client):
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


def test_an_answer_that_drips_is_given_up(serve, client):
    begin = time.monotonic()
    assert "no answer within" in refused(client(serve(drip), timeout_s=0.3, attempts=1))
    assert time.monotonic() - begin < 2


def test_a_broken_connection_is_tried_again(serve, client):
    server = serve(lambda handler: handler.connection.close(), good())
    assert client(server).material(view()).shape_class == "solid"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("It looks like plush to me.", "not JSON (it starts with 'It looks like plush to me.')"),
        ('{"materials": ', "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("[]", "at the top level"),
        (json.dumps(answer(shape_class="cube")), "at shape_class"),
        (json.dumps({k: v for k, v in answer().items() if k != "friction"}), "at friction"),
        (json.dumps(answer(surprise=1)), "at surprise"),
        (json.dumps(answer(density={"low": 5.0, "high": 1.0})), "at density"),
        (json.dumps(answer(density={"low": -1.0, "high": 1.0})), "at density"),
        (json.dumps(answer(density={"low": 1.0, "high": float("inf")})), "at density"),
        (json.dumps(answer(materials={"fur": 1.0})), "at materials"),
        (json.dumps(answer(materials=dict.fromkeys(MATERIALS, -1.0))), "at materials"),
        (json.dumps(answer(materials=dict.fromkeys(MATERIALS, 0.0))), "not all zero"),
    ],
)
def test_an_answer_that_does_not_fit_gets_one_line(serve, client, content, message):
    server = serve((200, {}, completion(content)))
    assert message in refused(client(server))
    assert len(server.requests) == 1


@pytest.mark.parametrize("reply", [b"<html>hello</html>", b"[]", b'{"choices": []}', b"\xff\xfe", b""])
def test_what_is_no_chat_completion_is_refused(serve, client, reply):
    assert "no chat completion" in refused(client(serve((200, {}, reply))))


def test_a_refusal_without_text_is_named(serve, client):
    assert "refusal" in refused(client(serve((200, {}, completion(None)))))


def test_a_wrong_key_is_reported_without_the_key(serve, client):
    server = serve((401, {}, {"error": {"message": f"Incorrect API key provided: {KEY}."}}))
    message = refused(client(server))
    assert "answered 401 (Incorrect API key provided: [key].)" in message
    assert len(server.requests) == 1


def test_no_server_there(serve, client):
    server = serve()
    prior = client(server)
    server.close()
    server.close = lambda: None
    assert "cannot be reached" in refused(prior)


def test_the_password_of_an_address_is_not_shown(serve, client):
    server = serve((404, {}, {}))
    prior = OpenAIPrior(server.url.replace("http://", "http://me:hush@"), model="m", api_key="")
    message = refused(prior)
    assert "hush" not in message
    assert "answered 404" in message


def test_the_same_question_is_asked_once(serve, client):
    server = serve(good())
    first = client(server).material(view())
    again = client(server).material(view())
    assert len(server.requests) == 1
    np.testing.assert_array_equal(first.distribution, again.distribution)
    assert first.properties == again.properties


def test_another_question_is_asked(serve, client):
    server = serve(good(), good(), good())
    client(server).material(view())
    client(server, model="other").material(view())
    brighter = view()
    client(server).material(view(image=255 - brighter.image))
    assert len(server.requests) == 3


def test_what_does_not_fit_is_not_kept(serve, client):
    server = serve((200, {}, completion("no")), good())
    refused(client(server))
    assert client(server).material(view()).shape_class == "solid"


def test_a_damaged_memory_is_asked_anew_and_mended(serve, client, tmp_path):
    server = serve(good(), good())
    client(server).material(view())
    (kept,) = (tmp_path / "cache").iterdir()
    kept.write_text('{"materials": ')
    client(server).material(view())
    client(server).material(view())
    assert len(server.requests) == 2
    assert list((tmp_path / "cache").iterdir()) == [kept]
    assert KEY not in kept.read_text()


def test_a_memory_that_cannot_be_written_costs_only_the_question(serve, client, tmp_path):
    (tmp_path / "file").write_text("")
    server = serve(good(), good())
    for _ in range(2):
        client(server, cache=tmp_path / "file" / "cache").material(view())
    assert len(server.requests) == 2


def test_a_hidden_part_is_judged_by_the_whole_object(serve, client):
    server = serve(good())
    prior = client(server)
    whole = view()
    prior.material(view(mask=whole.object_mask, label="object"))
    hidden = prior.material(view(mask=np.zeros((60, 80), bool), label="part 4"))
    assert len(server.requests) == 1
    assert hidden.warnings == ("part 4 is not visible on the keyframe: judged by the whole object",)
    nothing = np.zeros((60, 80), bool)
    assert "mask is empty" in refused(prior, view(mask=nothing, object_mask=nothing))


def test_what_no_twin_can_use_is_drawn_to_the_limit(serve, client):
    steel = {"stiffness": {"low": 1e11, "high": 3e11}, "density": {"low": 7000.0, "high": 8000.0}}
    prior = client(serve(good(**steel))).material(view())
    assert prior.properties["stiffness"].mean == 1e7
    assert "stiffness" in prior.warnings[0]
    foam = {"stiffness": {"low": 1e6, "high": 1e7}, "density": {"low": 10.0, "high": 40.0}}
    prior = client(serve(good(**foam))).material(view())
    assert prior.properties["stiffness"].mean == pytest.approx(5000 * 20)


def test_certainty_is_not_believed(serve, client):
    sure = {"friction": {"low": 0.5, "high": 0.5}}
    assert client(serve(good(**sure))).material(view()).properties["friction"].spread == 0.1


def test_settings_come_from_the_environment(serve, monkeypatch, tmp_path):
    server = serve(good())
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("MATPHYS_OPENAI_BASE_URL", server.url + "/")
    monkeypatch.setenv("MATPHYS_OPENAI_MODEL", "from-env")
    monkeypatch.setenv("OPENAI_API_KEY", KEY + "\n")
    prior = OpenAIPrior()
    prior.material(view())
    assert prior.weights == "from-env"
    assert server.requests[0][1]["Authorization"] == f"Bearer {KEY}"
    assert len(list((tmp_path / ".cache" / "matphys" / "priors").iterdir())) == 1


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, "MATPHYS_OPENAI_BASE_URL"),
        ({"base_url": "http://localhost:1/v1"}, "MATPHYS_OPENAI_MODEL"),
        ({"base_url": "localhost:1/v1", "model": "m"}, "http or https"),
        ({"base_url": "file:///etc", "model": "m"}, "http or https"),
        ({"base_url": "http://host:port/v1", "model": "m"}, "http or https"),
        ({"base_url": "http://localhost:1", "model": "m", "api_key": "sk-ключ"}, "OPENAI_API_KEY"),
        ({"base_url": "http://localhost:1", "model": "m", "api_key": "sk-a\nb"}, "OPENAI_API_KEY"),
    ],
)
def test_settings_that_cannot_work_are_refused_at_once(monkeypatch, settings, message):
    for name in ("MATPHYS_OPENAI_BASE_URL", "MATPHYS_OPENAI_MODEL", "OPENAI_API_KEY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(InputError, match=message) as caught:
        OpenAIPrior(**settings)
    assert settings.get("api_key", "nothing") not in str(caught.value)
