"""Who predicts, as the user says it."""

from pathlib import Path

from model.errors import InputError
from model.predictor import ALL_PREDICTORS, ParameterPredictor, TrainedPredictor

FILE = ".safetensors"
"""How the name of a file of a network ends."""


def predictor_named(wanted: str, *also: str) -> ParameterPredictor:
    """The predictor of that name, or the network in that file.

    Args:
        wanted: `matphys`, the network that comes with the package; `prior-mean`; or a file of `matphys fit`.
        also: What else the user may say where this is asked, for the message.

    Raises:
        InputError: no predictor has that name, or the file holds none.
    """
    if wanted.endswith(FILE):
        return TrainedPredictor(Path(wanted))
    methods = {method.name: method for method in ALL_PREDICTORS}
    if wanted not in methods:
        raise InputError(f"--predictor {wanted}: choose {', '.join([*also, *methods])}, or a {FILE} file")
    return methods[wanted]()
