"""The true values of an effect's quantities, where its label and our law mean the same by them.

The laws of other code have other constants: a rate of flow here is a hysteresis there. Comparable are a time
lag, a direction of gravity, a share of lost stiffness, a relative mass and a friction at rest.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

GRAVITY = 9.81
"""Of all worlds [m/s²]."""
Values = dict[str, float]


def _delay(effect: Mapping[str, Any]) -> Values:
    return {"delay": effect["amplitude"] * effect["options"]["sign"]}


def _tilt(effect: Mapping[str, Any]) -> Values:
    x, y, z = (effect["amplitude"] * part for part in effect["options"]["direction"])
    z -= GRAVITY
    size = math.sqrt(x * x + y * y + z * z)
    # Gravity turned about x by a, then about y by b, points to (-cos a sin b, sin a, -cos a cos b).
    return {"about_x": math.asin(y / size), "about_y": math.atan2(-x, -z)}


TRUE_VALUES: Mapping[str, Callable[[Mapping[str, Any]], Values]] = {
    "actuation_delay": _delay,
    "gravity_tilt": _tilt,
    "tension_only": lambda effect: {"slackness": effect["amplitude"]},
    "mass_heterogeneity": lambda effect: {"excess": effect["amplitude"]},
    "static_friction": lambda effect: {"excess_per_mass": GRAVITY * effect["amplitude"]},
}
"""By effect: of its label, the values of those quantities of ours that are comparable."""
