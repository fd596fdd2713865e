"""How an object moved, as numbers on its mass points: what the motion stage hands to the network."""

from dataclasses import dataclass

from jaxtyping import Float32

from model.types import Array


@dataclass(frozen=True)
class MotionFeatures:
    """Motion in a clip: of order one, finite, the same for a body shifted or turned about the vertical."""

    points: Float32[Array, "P D"]
    """Of each mass point."""
    whole: Float32[Array, " Dg"]
    """Of the clip as a whole."""
