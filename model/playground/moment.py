"""What there is to see of a session at one time."""

from dataclasses import dataclass

from jaxtyping import Float32, Float64

from model.playground.grip import Grip
from model.playground.settings import Settings
from model.types import Array


@dataclass(frozen=True)
class Moment:
    """What there is to see at one time. Never changed, so that any thread may read it."""

    frame: int
    """Counts all frames that were simulated."""
    points: tuple[Float32[Array, "N 3"], ...]
    """Of each actor [m], without its shift."""
    hands: tuple[Float64[Array, "C 3"], ...]
    """Where the hand of the clip holds each actor [m]."""
    grips: tuple[Grip, ...]
    settings: Settings
    running: bool
    motion: float | None
    """Of the recorded motion [s], while it plays."""
    hand: bool
    speed: float | None
    """Simulated seconds per second."""
    message: str = ""
    """The last thing the user should know."""
    idle: tuple[str, ...] = ()
    """Effects that cannot act as things are."""
    building: bool = False
    """A simulator is being made; the first time that a kind of it is asked for, it is compiled."""
    resets: int = 0
    """How often settings came from elsewhere than the user: a motion went wrong, a material was changed."""
