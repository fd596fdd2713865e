"""The gap report: what it takes, what it gives back, what it refuses in one line."""

import copy
import json
import subprocess
import sys

import pytest

from model.errors import InputError
from model.gap.schema import EFFECT_NAMES, SCHEMA, GapReport
from model.schema import read_json, write_json

CONTRACT_KEYS = ["schema", "verdict", "gap", "effects", "where", "sources", "warnings"]
GAP_KEYS = [
    "metric",
    "baseline",
    "refit",
    "with_effect",
    "noise_floor",
    "ceiling",
    "closed_fraction",
    "closed_fraction_ci95",
    "heldout",
]


def content():
    """The example of contract 5, for three points and two frames."""
    others = [name for name in EFFECT_NAMES if name != "quadratic_air_drag"]
    effects = [effect("quadratic_air_drag", 0.97), *(effect(name, 0.001) for name in others)]
    effects[0]["parameters"] = {"drag_per_mass": {"value": 0.5, "unit": "1/m", "ci95": [0.4, 0.6]}}
    effects[0]["confused_with"] = ["wind"]
    return {
        "schema": SCHEMA,
        "verdict": {"effect": "quadratic_air_drag", "probability": 0.97, "statement": "It is the air."},
        "gap": {
            "metric": "track_error_m",
            "baseline": 0.021,
            "refit": 0.014,
            "with_effect": 0.0031,
            "noise_floor": 0.0012,
            "ceiling": 0.0027,
            "closed_fraction": 0.85,
            "closed_fraction_ci95": [0.81, 0.88],
            "heldout": [[2.0, 3.0]],
        },
        "effects": effects,
        "where": {
            "points": [0.5, 0.25, 0.25],
            "frames": [0.4, 0.6],
            "parts": [{"part": "sleeve", "share": 0.75}, {"part": 1, "share": 0.25}],
            "phases": [{"name": "free", "start_s": 0.0, "end_s": 3.0, "share": 1.0}],
            "acts_on": [1.0, 1.0, 0.5],
        },
        "sources": {
            "perception": 0.1,
            "actuation": 0.0,
            "parameters": 0.35,
            "physics": 0.5,
            "unexplained": 0.05,
        },
        "warnings": ["hold it still for a second to tell wind from quadratic_air_drag"],
    }


def effect(name, probability):
    return {
        "name": name,
        "probability": probability,
        "heldout_error_m": 0.01,
        "evidence": 1.5,
        "parameters": {},
        "confused_with": [],
    }


def read(values):
    return read_json(json.dumps(values).encode(), GapReport, "report.json")


def changed(path, value):
    """The example with one value replaced."""
    values = copy.deepcopy(content())
    *steps, last = path
    inner = values
    for step in steps:
        inner = inner[step]
    inner[last] = value
    return values


def test_what_is_written_is_what_was_read():
    values = content()
    assert json.loads(write_json(read(values))) == values
    assert read(json.loads(write_json(read(values)))) == read(values)


def test_keys_are_those_of_the_contract():
    written = json.loads(write_json(read(content())))
    assert list(written) == CONTRACT_KEYS
    assert list(written["gap"]) == GAP_KEYS
    assert list(written["verdict"]) == ["effect", "probability", "statement"]


def test_a_second_interaction_has_the_same_figures():
    values = content()
    values["gap"]["transfer"] = values["gap"] | {"baseline": 0.03}
    written = json.loads(write_json(read(values)))
    assert list(written["gap"]["transfer"]) == GAP_KEYS
    assert written["gap"]["transfer"]["baseline"] == 0.03


def test_what_another_program_adds_is_kept():
    values = content() | {"device": "rig 2"}
    assert json.loads(write_json(read(values)))["device"] == "rig 2"


def test_the_rest_of_the_probability_is_left_for_nothing_and_unknown():
    assert read(content()).remainder == pytest.approx(1 - 0.97 - 16 * 0.001)


def test_without_an_effect_there_is_no_named_one():
    values = changed(("verdict", "effect"), "none")
    values["effects"] = sorted(
        ({**each, "probability": 0.001} for each in values["effects"]), key=lambda each: each["name"]
    )
    values["gap"] |= {"with_effect": None, "closed_fraction": None, "closed_fraction_ci95": None}
    report = read(values)
    assert report.named is None
    assert report.remainder == pytest.approx(1 - 0.97 - 17 * 0.001)


def test_two_effects_may_both_be_probable():
    values = changed(("effects", 1, "probability"), 0.9)
    with pytest.raises(InputError, match="sum to more"):
        read(values)
    values["verdict"]["second"] = values["effects"][1]["name"]
    assert read(values).verdict.second == values["effects"][1]["name"]


def test_a_second_effect_has_its_chance_once():
    """The verdict 0.6, its second 0.3, all others 0.03: less than a tenth is left for nothing, or unknown."""
    values = content()
    values["verdict"]["probability"] = values["effects"][0]["probability"] = 0.6
    values["effects"][1]["probability"] = 0.3
    for other in values["effects"][2:]:
        other["probability"] = 0.002
    values["verdict"]["second"] = values["effects"][1]["name"]
    assert read(values).remainder == pytest.approx(0.07)
    values["verdict"]["probability"] = values["effects"][0]["probability"] = 0.9
    assert read(values).remainder == 0.0


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("schema",), "matphys.gap/2", "schema: "),
        (("verdict", "effect"), "magnetism", "verdict.effect: "),
        (("verdict", "probability"), 1.2, "verdict.probability: "),
        (("verdict", "probability"), 0.5, "one probability of quadratic_air_drag"),
        (("verdict", "second"), "quadratic_air_drag", "verdict: expected a second effect"),
        (("gap", "metric"), "chamfer", "gap.metric: "),
        (("gap", "refit"), -0.1, "gap.refit: "),
        (("gap", "refit"), "0.014", "gap.refit: "),
        (("gap", "with_effect"), None, "without with_effect"),
        (("gap", "closed_fraction"), 0.5, "expected closed_fraction = "),
        (("gap", "closed_fraction"), None, "without a closed_fraction"),
        (("gap", "closed_fraction_ci95"), [0.9, 0.8], "the lower end first"),
        (("gap", "heldout"), [], "at least one span"),
        (("gap", "heldout"), [[3.0, 2.0]], "the lower end first"),
        (("effects",), [], "every effect of the catalogue"),
        (("effects", 3, "name"), "quadratic_air_drag", "every effect of the catalogue"),
        (("effects", 3, "name"), "gravity", "effects.3.name: "),
        (("effects", 16, "probability"), 0.002, "the most probable effect first"),
        (("effects", 0, "confused_with"), ["quadratic_air_drag"], "its own name"),
        (("effects", 0, "parameters", "drag_per_mass", "ci95"), [2.0, 1.0], "the lower end first"),
        (("where", "points"), [0.5, 0.25, 0.2], "where.points: expected shares that sum to 1"),
        (("where", "points"), [1.5, -0.25, -0.25], "where.points.0: "),
        (("where", "frames"), [], "where.frames: expected shares that sum to 1"),
        (("where", "parts", 0, "share"), 0.5, "where.parts: expected shares that sum to 1"),
        (("where", "phases", 0, "share"), 0.5, "where.phases: expected shares that sum to 1"),
        (("where", "phases", 0, "end_s"), -1.0, "the lower end first"),
        (("where", "acts_on"), [1.0, 1.0], "expected 3 values in acts_on as in points, found 2"),
        (("where", "acts_on", 0), 1.5, "where.acts_on.0: "),
        (("sources", "physics"), 0.9, "sources: expected shares that sum to 1"),
        (("warnings",), "one", "warnings: "),
    ],
)
def test_what_contradicts_the_contract_is_refused_in_one_line(path, value, message):
    with pytest.raises(InputError, match=message) as caught:
        read(changed(path, value))
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("report.json: ")


@pytest.mark.parametrize("key", CONTRACT_KEYS[:-1])
def test_what_is_missing_is_named(key):
    values = content()
    del values[key]
    with pytest.raises(InputError, match=f"report.json: {key} is missing"):
        read(values)


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e999"])
def test_numbers_are_finite(number):
    text = json.dumps(content()).replace("0.021", number)
    with pytest.raises(InputError, match="not a finite number"):
        read_json(text.encode(), GapReport, "report.json")


def test_the_verdict_is_the_most_probable_effect():
    values = content()
    values["verdict"] = {"effect": "wind", "probability": 0.001, "statement": ""}
    with pytest.raises(InputError, match="no effect more probable than the verdict 'wind'"):
        read(values)


def test_it_reaches_no_torch():
    code = "import sys, model.gap.schema; sys.exit(bool({'torch', 'numpy', 'matplotlib'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
