import pytest

from model.errors import InputError
from model.units import check_unit


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        ("N*s/m", "N*s/m"),
        ("N·s/m", "N*s/m"),
        ("N s/m", None),
        ("kg/s", "N*s/m"),
        ("m/s²", "m/s^2"),
        ("m s⁻²", None),
        ("m·s⁻²", "m/s^2"),
        ("m/s**2", "m/s^2"),
        ("s⁻¹", "1/s"),
        ("", "1"),
        ("kg/m³", "kg/m^3"),
        ("g/cm^3", None),
        ("cm", None),
        ("kPa", None),
    ],
)
def test_spellings(found: str, expected: str | None):
    for unit in ("1", "1/s", "N*s/m", "m/s^2", "kg/m^3", "Pa", "m"):
        if unit == expected:
            check_unit(found, unit, "here")
        else:
            with pytest.raises(InputError, match="here: expected"):
                check_unit(found, unit, "here")
