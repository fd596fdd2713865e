"""Which way a body lies, seen from above: probes that go along it are the same however it is turned."""

import numpy as np
from jaxtyping import Float64

from model.types import Array


def heading(points: Float64[Array, "N 3"]) -> float:
    """Angle [rad] about the vertical of the direction along which points spread most, -π..π.

    Of its two senses the one in which they reach out farther. It turns with the points, and does not depend
    on where they are or on their order.

    Args:
        points: At rest [m].
    """
    level = points[:, :2] - points[:, :2].mean(0)
    (xx, xy), (_, yy) = level.T @ level
    angle = 0.5 * float(np.arctan2(2.0 * xy, xx - yy))
    along = level @ np.array([np.cos(angle), np.sin(angle)])
    if float((along**3).sum()) < 0.0:
        angle += np.pi
    return wrapped(angle)


def wrapped(angle: float) -> float:
    """The same direction, -π..π [rad]."""
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


def turned_level(level: Float64[Array, "*n 2"], angle: float) -> Float64[Array, "*n 2"]:
    """Level vectors, turned about the vertical by an angle [rad]."""
    cosine, sine = np.cos(angle), np.sin(angle)
    turned: Float64[Array, "*n 2"] = level @ np.array([[cosine, sine], [-sine, cosine]])
    return turned


def from_axes(angle: float) -> float:
    """How far an angle [rad] is from the nearest of the axes x and y, -π/4..π/4."""
    quarter = 0.5 * np.pi
    return float(angle - quarter * np.round(angle / quarter))
