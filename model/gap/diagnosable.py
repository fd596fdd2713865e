"""Whether an observation can be diagnosed at all."""

from model.errors import InputError
from model.observation_doubts import hangs
from model.types import Observation

FRAMES = 12
"""A diagnosis fits to the first two thirds and predicts the rest; fewer leave too little of both."""


def check_diagnosable(observation: Observation, name: str) -> None:
    """Refuse what would give a verdict that means nothing.

    Args:
        observation: Within its contract.
        name: What the message calls it.

    Raises:
        InputError: too few frames, or an object in the air that nothing holds and that does not fall.
    """
    frames = len(observation.times)
    if frames < FRAMES:
        raise InputError(f"{name}: times: expected at least {FRAMES} frames to diagnose, found {frames}")
    if hangs(observation):
        raise InputError(
            f"{name}: controllers: expected the hand that holds the object, or ground_height where it lies: "
            "found neither near it, and it does not fall; no cause can be told from what is missing here"
        )
