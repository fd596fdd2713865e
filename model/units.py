"""Units as bundles write them: SI, and each in the spellings that are in use."""

from collections.abc import Mapping

from model.errors import InputError

PROPERTY_UNITS: Mapping[str, str] = {
    "stiffness": "Pa",
    "damping": "1",
    "drag_rate": "1/s",
    "friction": "1",
    "restitution": "1",
    "density": "kg/m^3",
}
"""Of every property of a material, as a prior has them."""
SPELLINGS: Mapping[str, tuple[str, ...]] = {
    "1": ("", "-"),
    "1/s": ("s^-1",),
    "N*s/m": ("N*s*m^-1", "kg/s"),
    "m/s^2": ("m*s^-2",),
    "kg/m^3": ("kg*m^-3",),
    "Pa": ("N/m^2",),
}
"""Other ways to write the same unit."""
SIGNS = str.maketrans({"·": "*", "⋅": "*", "²": "^2", "³": "^3", "⁻": "^-", "¹": "1", " ": ""})


def check_unit(found: str, expected: str, where: str) -> None:
    """Refuse what is no spelling of the unit `expected`.

    Raises:
        InputError: naming both.
    """
    plain = found.translate(SIGNS).replace("**", "^").replace("^-^", "^-")
    if plain != expected and plain not in SPELLINGS.get(expected, ()):
        raise InputError(f"{where}: expected {expected}, found {found!r}: give the value in {expected}")
