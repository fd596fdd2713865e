import json

import pytest

from model.bundle import TwinBundle


def with_parameter(members: dict[str, bytes], name: str, **changes) -> dict[str, bytes]:
    parameters = json.loads(members["parameters.json"])
    parameters[name] = parameters.get(name, {"value": 0, "unit": "1", "source": "user"}) | changes
    return {"parameters.json": json.dumps(parameters).encode()}


BROKEN = {
    "no friction": (lambda m: {"parameters.json": b"{}"}, "parameters.json: dashpot_damping is missing"),
    "negative friction": (
        lambda m: with_parameter(m, "friction", value=-1),
        "friction: expected one number of 0 to inf, found -1",
    ),
    "restitution above one": (
        lambda m: with_parameter(m, "restitution", value=1.5),
        "restitution: expected one number of 0 to 1, found 1.5",
    ),
    "friction of text": (
        lambda m: with_parameter(m, "friction", value="high"),
        "parameters.json: friction.value",
    ),
    "friction of two": (
        lambda m: with_parameter(m, "friction", value=[1, 2]),
        "friction: expected one number of 0 to inf, found [1.0, 2.0]",
    ),
    "source nobody knows": (
        lambda m: with_parameter(m, "friction", source="guessed"),
        "parameters.json: friction.source",
    ),
    "gravity of two": (
        lambda m: with_parameter(m, "gravity", value=[0, -9.81]),
        "gravity: expected one number or three, found 2",
    ),
    "ground of two": (
        lambda m: with_parameter(m, "ground_height", value=[0, 1]),
        "ground_height: expected one number, found",
    ),
    "ground in centimetres": (
        lambda m: with_parameter(m, "ground_height", value=20.0, unit="cm"),
        "parameters.json: ground_height.unit: expected m, found 'cm': give the value in m",
    ),
    "gravity in centimetres": (
        lambda m: with_parameter(m, "gravity", value=[0, 0, -981], unit="cm/s^2"),
        "gravity.unit: expected m/s^2, found 'cm/s^2'",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_parameters_are_refused(name: str, write_twin, members: dict[str, bytes], refusal):
    change, expected = BROKEN[name]
    assert expected in refusal(write_twin(files=change(members)))


@pytest.mark.parametrize("unit", ["m/s^2", "m/s²"])
def test_spellings_of_a_unit_are_read(write_twin, members: dict[str, bytes], unit: str):
    files = with_parameter(members, "gravity", value=-1.6, unit=unit)
    assert TwinBundle.load(write_twin(files=files)).parameters.globals["gravity"].unit == unit
