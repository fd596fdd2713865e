from types import SimpleNamespace

import pytest
import redis.exceptions

from worker import stable
from worker.stable import work


class Loop(SimpleNamespace):
    """Stands for a `Stable`: ends as it was told to."""

    def work(self, logging_level):
        self.told_to_stop = self.stops
        if self.problem is not None:
            raise self.problem


@pytest.mark.parametrize("problem", [None, redis.exceptions.ConnectionError()])
def test_who_is_told_to_stop_stops_though_redis_is_gone_too(monkeypatch, problem):
    """As when a front is killed, and its Redis and its worker end with it."""
    monkeypatch.setattr(stable, "CLOCK_S", 0.0)
    made = []

    def make(number):
        assert number < 2, "it goes on, though it was told to stop"
        made.append(Loop(stops=number == 1, problem=problem, told_to_stop=False))
        return made[-1]

    work(make)
    assert len(made) == 2


def test_a_loop_that_breaks_off_is_begun_anew(monkeypatch):
    monkeypatch.setattr(stable, "CLOCK_S", 0.0)
    numbers = []

    def make(number):
        numbers.append(number)
        if number == 0:
            raise redis.exceptions.ConnectionError
        broken = redis.exceptions.ConnectionError() if number == 1 else None
        return Loop(stops=number == 2, problem=broken, told_to_stop=False)

    work(make)
    assert numbers == [0, 1, 2]
