import json

import pytest

from model.schema import SourceRecord, content_id, write_json


def with_manifest(**changes) -> dict[str, bytes]:
    return {"twin.json": json.dumps({"schema": "matphys.twin/1"} | changes).encode()}


BROKEN = {
    "another schema": (
        lambda m: with_manifest(schema="matphys.twin/2"),
        "twin.json: schema: input should be 'matphys.twin/1', found 'matphys.twin/2'",
    ),
    "no schema": (lambda m: {"twin.json": b"{}"}, "twin.json: schema is missing"),
    "manifest of text": (lambda m: {"twin.json": b"hello"}, "twin.json: expected JSON"),
    "manifest of bytes": (lambda m: {"twin.json": b"\xff\xfe\x00"}, "twin.json: expected JSON"),
    "manifest of a list": (lambda m: {"twin.json": b"[]"}, "twin.json: the whole: "),
    "manifest nested without end": (lambda m: {"twin.json": b"[" * 100_000}, "twin.json: expected JSON"),
    "fps of text": (lambda m: with_manifest(source={"fps": "30"}), "twin.json: source.fps: "),
    "fps of zero": (
        lambda m: with_manifest(source={"fps": 0}),
        "source.fps: input should be greater than 0, found 0",
    ),
    "fps NaN": (
        lambda m: {"twin.json": b'{"schema": "matphys.twin/1", "source": {"fps": NaN}}'},
        "NaN is not a finite number",
    ),
    "unknown key NaN": (
        lambda m: {"twin.json": b'{"schema": "matphys.twin/1", "mine": 1e999}'},
        "1e999 is not a finite number",
    ),
    "camera NaN": (
        lambda m: {
            "twin.json": b'{"schema": "matphys.twin/1", "source": {"camera": {"intrinsics": [[NaN]]}}}'
        },
        "NaN",
    ),
    "camera of the wrong shape": (
        lambda m: with_manifest(source={"camera": {"intrinsics": [[1, 0, 0]]}}),
        "source.camera.intrinsics.1",
    ),
    "camera without a focal length": (
        lambda m: with_manifest(source={"camera": {"intrinsics": [[0, 0, 0], [0, 0, 0], [0, 0, 1]]}}),
        "expected ((fx, s, cx), (0, fy, cy), (0, 0, 1)) with fx and fy above 0",
    ),
    "camera that is nowhere": (
        lambda m: with_manifest(source={"camera": {"world_from_camera": [[0, 0, 0, 0]] * 4}}),
        "expected a rotation and a place [m]",
    ),
    "another frame": (
        lambda m: with_manifest(frame="y-up"),
        "twin.json: frame: expected the world frame 'z-up', found 'y-up'",
    ),
    "other units": (lambda m: with_manifest(units="mm kg s"), "twin.json: units: expected metres"),
    "parts of text": (lambda m: {"parts.json": b'["part"]'}, "parts.json: 0: "),
    "too few parts": (
        lambda m: {"parts.json": b'[{"label": "only"}]'},
        "part: expected labels 0..0 of parts.json, found 1",
    ),
    "improbable materials": (
        lambda m: {"parts.json": b'[{"label": "a", "materials": {"fabric": 0.5}}]'},
        "0.materials: expected probabilities that sum to 1",
    ),
    "overlay of something else": (
        lambda m: {"parts.json": b'[{"label": "a", "overlay": "aGVsbG8="}]'},
        "0.overlay: expected a PNG",
    ),
    "overlay of no base64": (
        lambda m: {"parts.json": b'[{"label": "a", "overlay": "???"}]'},
        "0.overlay: expected a PNG",
    ),
    "unknown effect": (lambda m: {"effects.json": b'[{"name": "magic"}]'}, "effects.json: 0.name"),
    "effect on too few": (
        lambda m: {"effects.json": b'[{"name": "wind", "acts_on": [1]}]'},
        "0.acts_on: expected a number for each of the 27 points, found 1",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_records_are_refused(name: str, write_twin, members: dict[str, bytes], refusal):
    change, expected = BROKEN[name]
    assert expected in refusal(write_twin(files=change(members)))


def test_the_id_follows_clip_options_and_version():
    first = content_id("aa", {"parts": 5, "seed": 0}, "1")
    assert first == content_id("aa", {"seed": 0, "parts": 5}, "1")
    others = [
        content_id("ab", {"parts": 5, "seed": 0}, "1"),
        content_id("aa", {"parts": 4, "seed": 0}, "1"),
        content_id("aa", {"parts": 5, "seed": 0}, "2"),
    ]
    assert len({first, *others}) == 4


def test_json_is_the_same_every_time_and_keeps_its_letters():
    record = SourceRecord(name="Bär.mp4", fps=30.0)
    assert write_json(record) == write_json(record)
    assert "Bär.mp4" in write_json(record).decode()
    with pytest.raises(ValueError, match="Out of range float"):
        write_json({"x": float("nan")})
