"""The plain twin of an object of which recordings are all that is known."""

from model.gap.bodies.body import body_of
from model.gap.bodies.flat import lies_flat
from model.gap.plain import PlainTwin
from model.types import Observation


def guessed_twin(observation: Observation, other: Observation | None = None) -> PlainTwin:
    """Made of what is seen in the first frame; what lies flat in the other recording is no solid in this one.

    Args:
        observation: What is diagnosed.
        other: Another recording of the object, if there is one.

    Raises:
        InputError: nothing can be built of the observation.
    """
    body = body_of(observation)
    if body.shape == "solid" and other is not None and lies_flat(other):
        body = body_of(observation, "sheet")
    return PlainTwin.of(body, observation)
