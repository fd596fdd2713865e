"""The openai prior against a fake server over real HTTP: what it asks, and what it believes."""

import json

import numpy as np
import pytest

from model.errors import InputError
from model.priors.materials import MATERIALS
from model.priors.openai import OpenAIPrior
from model.units import PROPERTY_UNITS


def test_a_good_answer_becomes_a_belief(serve, client, good, view):
    server = serve(good())
    prior = client(server).material(view())
    assert prior.distribution[MATERIALS.index("fur")] == pytest.approx(0.75)
    assert prior.distribution.sum() == pytest.approx(1.0)
    assert prior.shape_class == "solid"
    assert prior.warnings == ()
    assert {name: each.unit for name, each in prior.properties.items()} == dict(PROPERTY_UNITS)
    assert prior.properties["stiffness"].mean == pytest.approx(3e4)
    assert prior.properties["stiffness"].spread == pytest.approx(np.log(9) / (2 * 1.645))


def test_a_shape_that_is_known_is_told_and_believed(serve, client, good, view):
    server = serve(good())
    prior = client(server).material(view(shape_class="rope"))
    text = json.loads(server.requests[0][2])["messages"][0]["content"][0]["text"]
    assert "known to be of the shape class rope" in text
    assert prior.shape_class == "rope"


def test_the_request_is_a_chat_completion_with_picture_and_schema(serve, client, good, view, key):
    server = serve(good())
    prior = client(server)
    prior.material(view())
    path, headers, body = server.requests[0]
    request = json.loads(body)
    assert path == "/v1/chat/completions"
    assert headers["Authorization"] == f"Bearer {key}"
    assert request["model"] == prior.weights == "tiny-vlm"
    text, picture = request["messages"][0]["content"]
    assert "One part" in text["text"]
    assert picture["image_url"]["url"].startswith("data:image/png;base64,")
    wanted = request["response_format"]
    assert wanted["type"] == "json_schema"
    schema = wanted["json_schema"]["schema"]
    assert wanted["json_schema"]["strict"] is True
    assert schema["additionalProperties"] is False
    assert set(schema["required"]) == {"materials", "shape_class", *PROPERTY_UNITS}
    assert set(schema["$defs"]["Weights"]["required"]) == set(MATERIALS)
    # Strict endpoints take no keyword beside a reference.
    assert all(set(each) == {"$ref"} for each in schema["properties"].values() if "$ref" in each)
    assert key.encode() not in body


def test_without_a_key_none_is_sent(serve, client, good, view):
    server = serve(good())
    client(server, api_key="").material(view())
    assert "Authorization" not in server.requests[0][1]


def test_a_fenced_answer_is_read(serve, client, answer, completion, view):
    server = serve((200, {}, completion(f"```json\n{json.dumps(answer())}\n```")))
    assert client(server).material(view()).shape_class == "solid"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("It looks like plush to me.", "not JSON (it starts with 'It looks like plush to me.')"),
        ('{"materials": ', "not JSON"),
        ("[" * 100_000, "not JSON"),
        ("[]", "at the top level"),
    ],
)
def test_what_is_no_answer_gets_one_line(serve, client, content, message, completion, refused):
    server = serve((200, {}, completion(content)))
    assert message in refused(client(server))
    assert len(server.requests) == 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"shape_class": "cube"}, "at shape_class"),
        ({"surprise": 1}, "at surprise"),
        ({"density": {"low": 5.0, "high": 1.0}}, "at density"),
        ({"density": {"low": -1.0, "high": 1.0}}, "at density"),
        ({"density": {"low": 1.0, "high": float("inf")}}, "at density"),
        ({"materials": {"fur": 1.0}}, "at materials"),
        ({"materials": dict.fromkeys(MATERIALS, -1.0)}, "at materials"),
        ({"materials": dict.fromkeys(MATERIALS, 0.0)}, "not all zero"),
    ],
)
def test_an_answer_that_does_not_fit_gets_one_line(serve, client, changes, message, good, refused):
    server = serve(good(**changes))
    assert message in refused(client(server))
    assert len(server.requests) == 1


def test_an_answer_that_leaves_something_out_gets_one_line(serve, client, answer, completion, refused):
    content = json.dumps({name: value for name, value in answer().items() if name != "friction"})
    assert "at friction" in refused(client(serve((200, {}, completion(content)))))


@pytest.mark.parametrize("reply", [b"<html>hello</html>", b"[]", b'{"choices": []}', b"\xff\xfe", b""])
def test_what_is_no_chat_completion_is_refused(serve, client, reply, refused):
    assert "no chat completion" in refused(client(serve((200, {}, reply))))


def test_a_refusal_without_text_is_named(serve, client, completion, refused):
    assert "refusal" in refused(client(serve((200, {}, completion(None)))))


def test_a_wrong_key_is_reported_without_the_key(serve, client, refused, key):
    server = serve((401, {}, {"error": {"message": f"Incorrect API key provided: {key}."}}))
    message = refused(client(server))
    assert "answered 401 (Incorrect API key provided: [key].)" in message
    assert len(server.requests) == 1


def test_the_password_of_an_address_is_not_shown(serve, client, refused):
    server = serve((404, {}, {}))
    prior = OpenAIPrior(server.url.replace("http://", "http://me:hush@"), model="m", api_key="")
    message = refused(prior)
    assert "hush" not in message
    assert "answered 404" in message


def test_a_hidden_part_is_judged_by_the_whole_object(serve, client, good, view, refused):
    server = serve(good())
    prior = client(server)
    whole = view()
    prior.material(view(mask=whole.object_mask, label="object"))
    hidden = prior.material(view(mask=np.zeros((60, 80), bool), label="part 4"))
    assert len(server.requests) == 1
    assert hidden.warnings == ("part 4 is not visible on the keyframe: judged by the whole object",)
    nothing = np.zeros((60, 80), bool)
    assert "mask is empty" in refused(prior, view(mask=nothing, object_mask=nothing))


def test_what_no_twin_can_use_is_drawn_to_the_limit(serve, client, good, view):
    steel = {"stiffness": {"low": 1e11, "high": 3e11}, "density": {"low": 7000.0, "high": 8000.0}}
    prior = client(serve(good(**steel))).material(view())
    assert prior.properties["stiffness"].mean == 1e7
    assert "stiffness" in prior.warnings[0]
    foam = {"stiffness": {"low": 1e6, "high": 1e7}, "density": {"low": 10.0, "high": 40.0}}
    prior = client(serve(good(**foam))).material(view())
    assert prior.properties["stiffness"].mean == pytest.approx(5000 * 20)


def test_what_bounces_wholly_or_not_at_all_is_believed_nearly(serve, client, good, view):
    ball = {"restitution": {"low": 1.0, "high": 1.2}}
    assert client(serve(good(**ball))).material(view()).properties["restitution"].mean == 0.95
    mud = {"restitution": {"low": 0.0, "high": 0.1}}
    assert client(serve(good(**mud))).material(view()).properties["restitution"].mean == pytest.approx(0.01)


def test_certainty_is_not_believed(serve, client, good, view):
    sure = {"friction": {"low": 0.5, "high": 0.5}}
    assert client(serve(good(**sure))).material(view()).properties["friction"].spread == 0.1


def test_settings_come_from_the_environment(serve, monkeypatch, tmp_path, good, view, key):
    server = serve(good())
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("MATPHYS_OPENAI_BASE_URL", server.url + "/")
    monkeypatch.setenv("MATPHYS_OPENAI_MODEL", "from-env")
    monkeypatch.setenv("OPENAI_API_KEY", key + "\n")
    prior = OpenAIPrior()
    prior.material(view())
    assert prior.weights == "from-env"
    assert server.requests[0][1]["Authorization"] == f"Bearer {key}"
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
