"""What methods made of one clip: who leads another's twin does not fit it again."""

import time
from dataclasses import dataclass

from model.evaluation.baselines.base import Fitted, Method
from model.evaluation.synchronised import Synchronised
from model.scenes.case import Case


@dataclass(frozen=True)
class Fit:
    """What a method made of a clip, or why it made nothing."""

    fitted: Fitted | None
    failure: str | None
    seconds: float
    """It took; of a twin that is led as long as its own fit did."""


class Fits:
    """Of one clip, each made when it is first asked for."""

    def __init__(self) -> None:
        """None yet."""
        self._made: dict[str, Fit] = {}

    def of(self, method: Method, shown: Case) -> Fit:
        """The fit of a method.

        Args:
            method: Who fits.
            shown: The clip, the same each time: what of it may be seen.
        """
        name = method.identity()
        if name not in self._made:
            self._made[name] = (
                self._led(method, shown) if isinstance(method, Synchronised) else fit(method, shown)
            )
        return self._made[name]

    def _led(self, method: Synchronised, shown: Case) -> Fit:
        own = self.of(method.inner, shown)
        if own.fitted is None:
            return own
        try:
            return Fit(method.led(own.fitted, shown), None, own.seconds)
        except Exception as error:  # as in `fit`
            return Fit(None, reason(error), own.seconds)


def fit(method: Method, shown: Case) -> Fit:
    """What the method makes of a clip; one that breaks must not end an evaluation: the record says so."""
    began = time.perf_counter()
    try:
        made, failure = method.fit(shown), None
    except Exception as error:
        made, failure = None, reason(error)
    return Fit(made, failure, time.perf_counter() - began)


def fitter(method: Method) -> str:
    """The identity of the method whose fit it needs."""
    return fitter(method.inner) if isinstance(method, Synchronised) else method.identity()


def reason(error: Exception) -> str:
    """In one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())[:300]
